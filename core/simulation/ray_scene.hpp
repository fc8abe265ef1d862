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
  /// Of the angle between ray and surface normal, 0..1.
  float cos_incidence;
  Surface surface;
  /// Index of the body hit, in the order in which they were given to the scene.
  std::size_t body;
};

/// A mesh that goes steadily from one pose to another during a scan.
struct MovingMesh {
  std::size_t mesh;
  Eigen::Isometry3d T_map_start, T_map_end;
};

/// A body that stands for ever.
struct StandingMesh {
  std::size_t mesh;
  Eigen::Isometry3d T_map_mesh;
};

class RaySnapshot;

/// Meshes in a ray tracer's trees (Embree). Thread-safe once made.
class RayScene {
 public:
  RayScene(std::vector<const Mesh*> meshes, std::span<const StandingMesh> standing);
  ~RayScene();
  RayScene(const RayScene&) = delete;
  RayScene& operator=(const RayScene&) = delete;

  /// The scene during one scan. Bodies count from the standing ones on.
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
  /// The nearest hit of each ray. Quicker than one by one where they lie close together.
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
