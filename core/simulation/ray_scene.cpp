#include "core/simulation/ray_scene.hpp"

#include <embree3/rtcore.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <type_traits>
#include <utility>

namespace stillmap::simulation {
namespace {

struct Release {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
  void operator()(RTCGeometry geometry) const { rtcReleaseGeometry(geometry); }
};
using Device = std::unique_ptr<std::remove_pointer_t<RTCDevice>, Release>;
using Scene = std::unique_ptr<std::remove_pointer_t<RTCScene>, Release>;
using Geometry = std::unique_ptr<std::remove_pointer_t<RTCGeometry>, Release>;

Scene mesh_scene(RTCDevice device, const Mesh& mesh) {
  const Geometry geometry(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE));
  auto* vertices = static_cast<Eigen::Vector3f*>(
      rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                              sizeof(Eigen::Vector3f), mesh.vertices.size()));
  std::ranges::copy(mesh.vertices, vertices);
  auto* triangles = static_cast<std::array<std::uint32_t, 3>*>(
      rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                              3 * sizeof(std::uint32_t), mesh.triangles.size()));
  std::ranges::copy(mesh.triangles, triangles);
  rtcCommitGeometry(geometry.get());
  Scene scene(rtcNewScene(device));
  rtcSetSceneFlags(scene.get(), RTC_SCENE_FLAG_ROBUST);
  rtcAttachGeometry(scene.get(), geometry.get());
  rtcCommitScene(scene.get());
  return scene;
}

Geometry instance(RTCDevice device, RTCScene mesh, std::span<const Eigen::Isometry3d> poses) {
  Geometry geometry(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_INSTANCE));
  rtcSetGeometryInstancedScene(geometry.get(), mesh);
  rtcSetGeometryTimeStepCount(geometry.get(), static_cast<unsigned>(poses.size()));
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Eigen::Matrix4f matrix = poses[i].matrix().cast<float>();
    rtcSetGeometryTransform(geometry.get(), static_cast<unsigned>(i),
                            RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR, matrix.data());
  }
  rtcCommitGeometry(geometry.get());
  return geometry;
}

void put(const Ray& ray, std::size_t i, RTCRayHit16& packet) {
  packet.ray.org_x[i] = ray.origin_map.x();
  packet.ray.org_y[i] = ray.origin_map.y();
  packet.ray.org_z[i] = ray.origin_map.z();
  packet.ray.dir_x[i] = ray.direction_map.x();
  packet.ray.dir_y[i] = ray.direction_map.y();
  packet.ray.dir_z[i] = ray.direction_map.z();
  packet.ray.tfar[i] = ray.max_range_m;
  packet.ray.time[i] = ray.time;
  packet.ray.mask[i] = ~0U;
  packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
  packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
}

}  // namespace

struct RayScene::Trees {
  std::vector<const Mesh*> meshes;
  Device device;
  std::vector<Scene> scenes;
  std::vector<Geometry> standing;
  std::vector<std::size_t> standing_mesh;
  std::vector<Eigen::Matrix3f> standing_rotation;
};

struct RaySnapshot::Bodies {
  const std::vector<const Mesh*>& meshes;
  Scene scene;
  std::vector<std::size_t> mesh;
  std::vector<Eigen::Matrix3f> rotation;

  [[nodiscard]] std::optional<RayHit> hit(const RTCRayHit16& packet, std::size_t i,
                                          const Ray& ray) const {
    if (packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
    const std::size_t body = packet.hit.instID[0][i];
    const Eigen::Vector3f normal_mesh(packet.hit.Ng_x[i], packet.hit.Ng_y[i], packet.hit.Ng_z[i]);
    const Eigen::Vector3f normal_map = rotation[body] * normal_mesh.normalized();
    return RayHit{.range_m = packet.ray.tfar[i],
                  .cos_incidence = std::abs(normal_map.dot(ray.direction_map)),
                  .surface = meshes[mesh[body]]->surfaces[packet.hit.primID[i]],
                  .body = body};
  }
};

RayScene::RayScene(std::vector<const Mesh*> meshes, std::span<const StandingMesh> standing)
    : trees_(std::make_unique<Trees>()) {
  trees_->meshes = std::move(meshes);
  trees_->device.reset(rtcNewDevice(nullptr));
  if (!trees_->device) throw std::runtime_error("The ray tracer Embree gives no device.");
  for (const Mesh* mesh : trees_->meshes) {
    trees_->scenes.push_back(mesh_scene(trees_->device.get(), *mesh));
  }
  for (const StandingMesh& body : standing) {
    trees_->standing.push_back(instance(trees_->device.get(), trees_->scenes[body.mesh].get(),
                                        std::span(&body.T_map_mesh, 1)));
    trees_->standing_mesh.push_back(body.mesh);
    trees_->standing_rotation.emplace_back(body.T_map_mesh.rotation().cast<float>());
  }
}

RayScene::~RayScene() = default;

RaySnapshot RayScene::with(std::span<const MovingMesh> moving) const {
  auto bodies = std::make_unique<RaySnapshot::Bodies>(
      trees_->meshes, Scene(rtcNewScene(trees_->device.get())), trees_->standing_mesh,
      trees_->standing_rotation);
  RTCScene scene = bodies->scene.get();
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  unsigned id = 0;
  for (const Geometry& body : trees_->standing) rtcAttachGeometryByID(scene, body.get(), id++);
  for (const MovingMesh& body : moving) {
    const std::array<Eigen::Isometry3d, 2> poses{body.T_map_start, body.T_map_end};
    const Geometry geometry =
        instance(trees_->device.get(), trees_->scenes[body.mesh].get(), poses);
    rtcAttachGeometryByID(scene, geometry.get(), id++);
    bodies->mesh.push_back(body.mesh);
    bodies->rotation.emplace_back(body.T_map_start.rotation().cast<float>());
  }
  rtcCommitScene(scene);
  return RaySnapshot(std::move(bodies));
}

RaySnapshot::RaySnapshot(std::unique_ptr<Bodies> bodies) : bodies_(std::move(bodies)) {}
RaySnapshot::RaySnapshot(RaySnapshot&&) noexcept = default;
RaySnapshot::~RaySnapshot() = default;

std::optional<RayHit> RaySnapshot::cast(const Ray& ray) const {
  std::optional<RayHit> hit;
  cast(std::span(&ray, 1), std::span(&hit, 1));
  return hit;
}

void RaySnapshot::cast(std::span<const Ray> rays, std::span<std::optional<RayHit>> hits) const {
  assert(rays.size() == hits.size() && rays.size() <= max_rays);
  alignas(64) std::array<int, max_rays> valid{};
  RTCRayHit16 packet{};
  for (std::size_t i = 0; i < rays.size(); ++i) {
    valid[i] = -1;
    put(rays[i], i, packet);
  }
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcIntersect16(valid.data(), bodies_->scene.get(), &context, &packet);
  for (std::size_t i = 0; i < rays.size(); ++i) hits[i] = bodies_->hit(packet, i, rays[i]);
}

}  // namespace stillmap::simulation
