#include "synthetic/tracer.h"

#include <embree3/rtcore.h>

#include <limits>
#include <stdexcept>
#include <string>

namespace omnifleet::synthetic {

struct Tracer::Scenes {
  RTCDevice device = nullptr;
  RTCScene top = nullptr;
  std::vector<RTCScene> meshes;
  std::vector<RTCGeometry> instances;

  ~Scenes() {
    for (RTCGeometry instance : instances) rtcReleaseGeometry(instance);
    for (RTCScene mesh : meshes) rtcReleaseScene(mesh);
    if (top) rtcReleaseScene(top);
    if (device) rtcReleaseDevice(device);
  }

  void check(const char* what) const {
    if (const RTCError error = rtcGetDeviceError(device); error != RTC_ERROR_NONE) {
      throw std::runtime_error(std::string("Embree: ") + what + " failed with error " +
                               std::to_string(error));
    }
  }
};

namespace {

RTCScene sceneOf(RTCDevice device, const SolidMesh& mesh) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), mesh.vertices.size()));
  auto* indices = static_cast<std::uint32_t*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(std::uint32_t),
                              mesh.triangles.size()));
  if (!vertices || !indices) throw std::runtime_error("Embree: cannot allocate a mesh");
  for (const Eigen::Vector3f& v : mesh.vertices) {
    for (int c = 0; c < 3; ++c) *vertices++ = v[c];
  }
  for (const auto& triangle : mesh.triangles) {
    for (std::uint32_t index : triangle) *indices++ = index;
  }
  rtcCommitGeometry(geometry);
  RTCScene scene = rtcNewScene(device);
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene);
  return scene;
}

}  // namespace

Tracer::Tracer(const std::vector<SolidMesh>& meshes) : scenes_(std::make_unique<Scenes>()) {
  // One thread without affinity, because every camera is a separate process.
  scenes_->device = rtcNewDevice("threads=1,set_affinity=0");
  if (!scenes_->device) throw std::runtime_error("Embree: cannot create a device");
  scenes_->top = rtcNewScene(scenes_->device);
  rtcSetSceneFlags(scenes_->top, static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_DYNAMIC));
  for (const SolidMesh& mesh : meshes) {
    scenes_->meshes.push_back(sceneOf(scenes_->device, mesh));
    RTCGeometry instance = rtcNewGeometry(scenes_->device, RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(instance, scenes_->meshes.back());
    rtcSetGeometryTimeStepCount(instance, 1);
    rtcAttachGeometryByID(scenes_->top, instance, static_cast<unsigned>(scenes_->instances.size()));
    scenes_->instances.push_back(instance);
  }
  scenes_->check("building the scene");
}

Tracer::~Tracer() = default;

void Tracer::place(const std::vector<Eigen::Affine3f>& frame_from_solids) {
  for (std::size_t i = 0; i < scenes_->instances.size(); ++i) {
    const Eigen::Matrix<float, 3, 4> matrix = frame_from_solids[i].matrix().topRows<3>();
    rtcSetGeometryTransform(scenes_->instances[i], 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, matrix.data());
    rtcCommitGeometry(scenes_->instances[i]);
  }
  rtcCommitScene(scenes_->top);
  scenes_->check("placing the solids");
}

void Tracer::trace(const Eigen::Vector3f& origin_m, RayPacket& rays) const {
  alignas(64) RTCRayHit16 packet;
  alignas(64) int valid[RayPacket::kSize];
  for (int i = 0; i < RayPacket::kSize; ++i) {
    valid[i] = (rays.wanted >> i & 1U) ? -1 : 0;
    packet.ray.org_x[i] = origin_m.x();
    packet.ray.org_y[i] = origin_m.y();
    packet.ray.org_z[i] = origin_m.z();
    packet.ray.dir_x[i] = rays.x[i];
    packet.ray.dir_y[i] = rays.y[i];
    packet.ray.dir_z[i] = rays.z[i];
    packet.ray.tnear[i] = 0.0f;
    packet.ray.tfar[i] = std::numeric_limits<float>::infinity();
    packet.ray.time[i] = 0.0f;
    packet.ray.mask[i] = ~0U;
    packet.ray.flags[i] = 0;
    packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcIntersect16(valid, scenes_->top, &context, &packet);
  for (int i = 0; i < RayPacket::kSize; ++i) {
    const bool hit = valid[i] && packet.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
    rays.solid[i] = hit ? static_cast<int>(packet.hit.instID[0][i]) : -1;
    rays.triangle[i] = hit ? static_cast<int>(packet.hit.primID[i]) : 0;
    rays.distance[i] = packet.ray.tfar[i];
  }
}

}  // namespace omnifleet::synthetic
