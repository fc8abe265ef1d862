#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/simulation/mesh.hpp"

namespace stillmap::simulation {

struct Ray {
  Eigen::Vector3f origin_map = Eigen::Vector3f::Zero();
  /// Unit length.
  Eigen::Vector3f direction_map = Eigen::Vector3f::UnitX();
  float max_range_m = 0.0F;
  /// 0 = start, 1 = end of the scan.
  float time = 0.0F;
};

struct RayHit {
  float range_m;
  /// Absolute cosine of the angle between ray and surface normal, 0..1.
  float cos_incidence;
  Surface surface;
  /// Index of the body hit: the standing ones in order, then the moving ones.
  std::size_t body;
};

/// A mesh that moves linearly from one pose to another during a scan.
struct MovingMesh {
  std::size_t mesh;
  Eigen::Isometry3d T_map_start, T_map_end;
};

/// A mesh that never moves.
struct StandingMesh {
  std::size_t mesh;
  Eigen::Isometry3d T_map_mesh;
};

class RaySnapshot;

/// Meshes and standing bodies in Embree's bounding volume hierarchies. Thread-safe once built.
/// @pre the meshes outlive it.
class RayScene {
 public:
  RayScene(std::vector<const Mesh*> meshes, std::span<const StandingMesh> standing);
  ~RayScene();
  RayScene(const RayScene&) = delete;
  RayScene& operator=(const RayScene&) = delete;

  /// The scene during one scan, with these bodies behind the standing ones.
  [[nodiscard]] RaySnapshot with(std::span<const MovingMesh> moving) const;

 private:
  friend class RaySnapshot;
  struct Trees;
  std::unique_ptr<Trees> trees_;
};

/// The scene during one scan; must not outlive its `RayScene`. Thread-safe.
class RaySnapshot {
 public:
  ~RaySnapshot();
  RaySnapshot(RaySnapshot&&) noexcept;
  RaySnapshot& operator=(RaySnapshot&&) = delete;

  /// The nearest hit, if any.
  [[nodiscard]] std::optional<RayHit> cast(const Ray& ray) const;
  /// The nearest hit of each ray; faster than single casts where rays are close together.
  /// @pre rays.size() == hits.size() <= max_rays
  void cast(std::span<const Ray> rays, std::span<std::optional<RayHit>> hits) const;
  static constexpr std::size_t max_rays = 16;

 private:
  friend class RayScene;
  struct Bodies;
  explicit RaySnapshot(std::unique_ptr<Bodies> bodies);
  std::unique_ptr<Bodies> bodies_;
};

}  // namespace stillmap::simulation
