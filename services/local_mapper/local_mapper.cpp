#include "local_mapper/local_mapper.h"

#include "local_mapper/scene_cut.h"
#include "local_mapper/view_blocks.h"

namespace omnifleet::local_mapper {

Options Options::read(const options::Section& section) {
  Options o;
  o.check = FrameCheckOptions::read(section.child("frame"));
  o.faults = FaultOptions::read(section.child("faults"));
  o.lens_occlusion = LensOcclusionOptions::read(section.child("lens_occlusion"));
  o.view = ground::ViewOptions::read(section.child("view"));
  o.lens = lens::CorrectionOptions::read(section.child("lens"));
  o.ground = ground::SegmenterOptions::read(section.child("ground"));
  o.walls = ground::WallOptions::read(section.child("walls"));
  o.connection = ground::ConnectionOptions::read(section.child("connection"));
  o.contour = ground::ContourOptions::read(section.child("contour"));
  o.split = ground::SplitOptions::read(section.child("split"));
  o.notches = ground::NotchOptions::read(section.child("notches"));
  o.silhouette = SilhouetteOptions::read(section.child("silhouette"));
  o.scan = ScanOptions::read(section.child("scan"));
  o.boundary = ground::BoundaryOptions::read(section.child("boundary"));
  o.skirting = ground::SkirtingOptions::read(section.child("skirting"));
  o.floor_motion = FloorOdometryOptions::read(section.child("floor_motion"));
  o.flow = flow::FeatureFlowOptions::read(section.child("flow"));
  section.finish();
  return o;
}

static ground::SegmenterOptions groundOptions(const Options& o) {
  ground::SegmenterOptions ground = o.ground;
  ground.low_walls = ground.low_walls && o.walls.enabled;
  return ground;
}

/// The steps of §III in their order, with the buffers that are kept from frame to frame.
struct LocalMapper::Stages {
  Stages(const lens::Camera& c, const Options& o, const cv::Mat1b& occluded)
      : options(o),
        camera(c),
        correction(lens::correctionCamera(c, o.lens)),
        view(camera, o.view, occluded),
        check(camera.model(), view.mask(), o.check),
        freeze(view, o.faults),
        occlusion(o.faults),
        segmenter(camera, view, groundOptions(o)),
        walls(camera, view, o.walls, o.ground),
        connection(o.connection),
        tracer(view, o.contour),
        splitter(view.imageSize(), o.split),
        notches(view, o.notches),
        silhouette(correction, view, o.silhouette),
        scan(correction, view, o.scan),
        boundary(camera, view, o.boundary),
        skirting(camera.height(), boundary, o.skirting),
        flow(correction, o.flow) {
    if (o.floor_motion.use != "always") return;
    try {
      floor_odometry.emplace(camera, view, o.floor_motion.alignment);
    } catch (const options::Error&) {
      if (!o.floor_motion.is_optional) throw;
    }
  }
  Stages(const Stages&) = delete;  // the steps refer to camera and view
  Stages& operator=(const Stages&) = delete;

  void begin(const Frame& frame, const Motion& wheels);
  FrameState findRegions(const cv::Mat& image, const Motion& wheels);
  void discard();
  void forget();
  OcclusionCheck::FrameContent content() const;
  void measureObjects(const cv::Mat& image);
  void findBoundary(const cv::Mat& image, const Motion& own);
  bool measureParts(const cv::Mat& image, const ground::Blob& blob);
  void measurePart(const std::vector<ground::Blob>& parts, std::size_t i, bool by_colour);
  ground::ContourFrame contourFrame(const cv::Mat& image, const cv::Mat1b& objects) const {
    return {image, flow.grey(), objects, segmenter.floorColour(), static_cast<float>(segmenter.noise().hue)};
  }
  void keep(bool is_object, const ground::Blob& blob);
  void addUndecided(const std::vector<ground::Blob>& regions,
                    FloorScan::Candidate candidate = FloorScan::Candidate::kRegion);

  Options options;
  lens::Camera camera;
  lens::Camera correction;  // §III.4: for single points
  ground::FloorView view;
  FrameCheck check;
  FreezeCheck freeze;
  OcclusionCheck occlusion;
  ground::GroundSegmenter segmenter;
  ground::Labeller labeller;
  ground::WallFinder walls;
  ground::RegionConnection connection;
  ground::ContourTracer tracer;
  ground::BlobSplitter splitter;
  ground::NotchSplitter notches;
  Silhouette silhouette;
  FloorScan scan;
  ground::FloorBoundary boundary;
  ground::Skirting skirting;
  std::optional<FloorOdometry> floor_odometry;
  flow::FeatureFlow flow;

  const std::vector<ground::Blob>* labelled = nullptr;
  const std::vector<ground::Blob>* blobs = nullptr;
  std::vector<ground::Blob>
      object_blobs;  // region of each object; may have more entries than there are objects
  std::vector<std::size_t> blob_of_object;
  std::vector<ground::Contour> part_contours;
  std::vector<double> part_contact_m;
  std::vector<bool> hides;
  std::vector<FloorContour> contours;  // of the objects, kept for reuse of their buffers
  ground::Contour contour;
  ObjectObservation object;
  std::vector<Eigen::Vector2d> undecided_m;
  bool has_walls = false;
  std::vector<float> wall_inverse_m;  // by beam of the boundary
  FrameFault fault;
  LocalMap map;
  std::vector<ObjectObservation> spare_objects;  // for their buffers: the n-th object reuses the n-th
};

/// Checks whether and where the frames show the scene. It outlives the stages, which are rebuilt when another
/// part of the view is occluded.
struct LocalMapper::Watch {
  Watch(const lens::Camera& c, const ground::FloorView& view, const Options& o)
      : camera(c), blocks(camera, view), occlusion(blocks, o.lens_occlusion), cut(blocks) {}
  Watch(const Watch&) = delete;  // the members refer to camera and blocks
  Watch& operator=(const Watch&) = delete;

  lens::Camera camera;
  ViewBlocks blocks;
  LensOcclusion occlusion;
  SceneCut cut;
  bool is_cut = false;
};

LocalMapper::LocalMapper(const lens::Camera& camera, const Options& options)
    : stages_(std::make_unique<Stages>(camera, options, cv::Mat1b())),
      watch_(std::make_unique<Watch>(camera, stages_->view, options)) {}
LocalMapper::~LocalMapper() = default;
LocalMapper::LocalMapper(LocalMapper&&) noexcept = default;
LocalMapper& LocalMapper::operator=(LocalMapper&&) noexcept = default;

/// Rebuilds the stages. What is occluded is then outside of their view.
void LocalMapper::restart() {
  try {
    auto next = std::make_unique<Stages>(stages_->camera, stages_->options, watch_->occlusion.mask());
    next->check.resume(stages_->check);
    stages_ = std::move(next);
    is_blind_ = false;
  } catch (const options::Error&) {
    is_blind_ = true;
  }
}

void LocalMapper::watch(const Frame& frame, const Motion& wheels) {
  if (frame.state != FrameState::kOk || !stages_->check.fits(frame.image)) return;
  Watch& w = *watch_;
  w.blocks.read(frame.image);
  const bool was_cut = w.is_cut;
  w.is_cut = stages_->options.faults.occlusion_step > 0.0 && w.cut.update(w.occlusion.usable(), wheels);
  if (was_cut && !w.is_cut) w.blocks.forgetBefore();
  if (!w.is_cut && w.occlusion.update(wheels)) restart();
}

const LocalMap& LocalMapper::process(const Frame& frame, const Motion& wheels) {
  watch(frame, wheels);
  Stages& s = *stages_;
  s.begin(frame, wheels);
  s.map.state = s.check.check(frame);
  if (s.map.state == FrameState::kOk && is_blind_) {
    s.map.state = FrameState::kDark;
    s.fault = {ErrorCode::kLensOccluded,
               "lens occluded next to the robot, where the floor's colour is learned; clean the lens"};
  }
  if (s.map.state == FrameState::kOk && watch_->is_cut) {
    s.map.state = FrameState::kDark;
    s.fault = {ErrorCode::kLensOccluded,
               "lens occluded: the whole image changed within one frame and does not move with the robot; "
               "clean the lens"};
  }
  if (s.map.state == FrameState::kOk) s.map.state = s.findRegions(frame.image, wheels);
  if (!s.check.follows() || s.map.state != FrameState::kOk) s.forget();
  if (s.map.state != FrameState::kOk) return s.map;
  s.flow.push(frame.image, {s.segmenter.cellMeans(), s.view.rows()}, *s.blobs);  // §III.3: pyramid
  s.measureObjects(frame.image);  // §III.4–5: outline on the floor, hull, scan
  s.freeze.setObjectCount(s.map.objects.size());
  s.fault = s.occlusion.faultOf(s.content(), wheels);
  if (s.fault.code != ErrorCode::kNone) {
    s.discard();
    return s.map;
  }
  if (s.floor_odometry)
    s.map.floor_motion = s.floor_odometry->add(frame.acquired_ns, frame.image, s.segmenter.objects(), wheels);
  const Motion own = wheels.valid ? wheels : asMotion(s.map.floor_motion);
  s.findBoundary(frame.image, own);
  s.flow.track(s.object_blobs, s.blob_of_object, own, s.map.objects);  // eq. 2–7 and the filter of §III.5
  if (s.options.silhouette.outline == "features") {
    for (ObjectObservation& object : s.map.objects) s.silhouette.measureFeatures(object);
  }
  return s.map;
}

/// The next frame does not follow those before.
void LocalMapper::Stages::forget() {
  flow.forget();
  if (floor_odometry) floor_odometry->forget();
}

/// Rejects what an occluded camera shows.
void LocalMapper::Stages::discard() {
  map.state = FrameState::kDark;
  forget();
  map.scan.range_m.clear();
  map.scan.sigma_m.clear();
  map.scan.label.clear();
  map.scan.object.clear();
  map.boundary.clear();
}

OcclusionCheck::FrameContent LocalMapper::Stages::content() const {
  cv::Vec3d sum(0, 0, 0);
  for (const cv::Point& cell : view.seedCells()) sum += cv::Vec3d(segmenter.cellMeans()(cell));
  const cv::Vec3f floor = sum / static_cast<double>(view.seedCells().size());
  const bool shows_objects = !map.objects.empty() || has_walls;
  return {
      map.objects.size(), has_walls, floor,
      shows_objects ? HorizonState::kVisible : classifyHorizon(segmenter.horizon(), segmenter.cellMeans())};
}

void LocalMapper::Stages::begin(const Frame& frame, const Motion& wheels) {
  map.acquired_ns = frame.acquired_ns;
  map.sequence = frame.sequence;
  map.camera_height_m = camera.height();
  map.motion = wheels;
  map.floor_motion = {};
  for (; !map.objects.empty(); map.objects.pop_back()) spare_objects.push_back(std::move(map.objects.back()));
  silhouette.forgetRejected();
  flow.forgetRejected();
  undecided_m.clear();
  fault = {};
  map.scan.range_m.clear();
  map.scan.sigma_m.clear();
  map.scan.label.clear();
  map.scan.object.clear();
  map.boundary.clear();
}

FrameState LocalMapper::Stages::findRegions(const cv::Mat& image, const Motion& wheels) {
  const bool has_floor = segmenter.segment(image);  // §III.2: ground removed by its histogram
  if (freeze.isFrozen(segmenter.cellMeans(), wheels)) {
    fault = {ErrorCode::kImageFrozen,
             "image frozen: it stays the same while the wheels turn; restart the camera"};
    return FrameState::kOutOfOrder;  // an old image with a new time
  }
  if (!has_floor) return FrameState::kDark;
  labelled = &labeller.label(segmenter.bits(), segmenter.area(), options.silhouette.min_area_px);
  has_walls = walls.find(image, *labelled, options.silhouette.min_area_px, segmenter);
  if (has_walls) labelled = &walls.regions();
  blobs = &connection.connect(*labelled);  // Algorithm 1
  return FrameState::kOk;
}

void LocalMapper::Stages::measureObjects(const cv::Mat& image) {
  blob_of_object.clear();
  scan.begin();
  bool closed = has_walls;
  if (has_walls)
    scan.findWalls({image, segmenter.objects(), walls.kinds(), segmenter.blockSize(), walls.foot()});
  for (const ground::Blob& blob : *blobs) {
    tracer.trace(contourFrame(image, segmenter.objects()), blob, contour);
    const bool is_object = silhouette.measure(blob, contour, {}, object) &&
                           (!has_walls || scan.isInFrontOfWalls(silhouette.floorContour(), object.contact_m));
    if (is_object && silhouette.isLine()) continue;
    if (is_object && object.solidity < options.split.max_solidity && measureParts(image, blob)) continue;
    keep(is_object, blob);
    closed = closed || silhouette.isAround();
  }
  if (closed) scan.addAll(segmenter.objects());
  if (has_walls) scan.addWalls();
  addUndecided(segmenter.undecided());
  addUndecided(segmenter.boards(), FloorScan::Candidate::kBoard);
  addUndecided(segmenter.intensityEdges(), FloorScan::Candidate::kIntensityEdge);
  addUndecided(segmenter.coarseTexture(), FloorScan::Candidate::kIntensityEdge);
  if (!has_walls) {  // a shadow on a wall is no object in front of it
    addUndecided(segmenter.vague());
    for (const ground::Blob& face : segmenter.faces()) scan.addUndecided(face, FloorScan::Candidate::kRegion);
  }
  scan.finish(map.scan);
}

/// The boundary of the floor. Walls of nearly the floor's colour are no regions; the scan says where they
/// stand. In a room the boundary ends at the foot of skirting boards, and so does the scan.
void LocalMapper::Stages::findBoundary(const cv::Mat& image, const Motion& own) {
  map.boundary = boundary.find(image, segmenter.objects());
  if (!has_walls) return;
  const std::size_t beams = map.boundary.inverse_m.size(), rays = map.scan.range_m.size();
  wall_inverse_m.assign(beams, 0.0f);
  for (std::size_t beam = 0; beam < beams; ++beam) {
    const std::size_t ray = beam * rays / beams;
    const bool ends_at_wall = map.scan.label[ray] == RayLabel::kObstacle && map.scan.object[ray] == 0;
    if (ends_at_wall && map.scan.range_m[ray] > 0.0f) wall_inverse_m[beam] = 1.0f / map.scan.range_m[ray];
  }
  boundary.complete(image, wall_inverse_m, map.boundary);
  const std::vector<ground::Skirting::End>& ends = skirting.apply(image, own, map.boundary);
  for (std::size_t ray = 0; ray < rays; ++ray) {
    const std::size_t beam = ray * beams / rays;
    if (ends[beam] == ground::Skirting::End::kOther) continue;
    const bool is_foot = ends[beam] == ground::Skirting::End::kFoot;
    const float inverse =
                    map.boundary.inverse_m[beam] * static_cast<float>(is_foot ? 1.0 : skirting.factor()),
                range_m = 1.0f / inverse;
    if (map.scan.range_m[ray] <= range_m) continue;
    map.scan.range_m[ray] = range_m;
    map.scan.sigma_m[ray] = map.boundary.sigma[beam] * range_m * range_m;
    if (!is_foot)
      map.scan.label[ray] = RayLabel::kUndecided;
    else if (map.scan.label[ray] == RayLabel::kFloorEnd)
      map.scan.label[ray] = RayLabel::kObstacle;
  }
}

void LocalMapper::Stages::addUndecided(const std::vector<ground::Blob>& regions,
                                       FloorScan::Candidate candidate) {
  for (const ground::Blob& blob : regions) {
    const auto contact_m = scan.addUndecided(blob, candidate);
    if (contact_m && (*contact_m - camera.foot()).norm() <= options.silhouette.max_contact_m)
      undecided_m.push_back(*contact_m);
  }
}

/// Measures each object of a region that shows several. @return false where it is one object
bool LocalMapper::Stages::measureParts(const cv::Mat& image, const ground::Blob& blob) {
  const auto* parts = &splitter.split(image, blob);
  const bool by_colour = !parts->empty();
  if (!by_colour) parts = &notches.split(blob, contour);
  if (parts->empty()) return false;
  const cv::Mat1b& mask = by_colour ? splitter.mask() : notches.mask();
  part_contact_m.assign(parts->size(), 0.0);
  if (part_contours.size() < parts->size()) part_contours.resize(parts->size());
  for (std::size_t i = 0; i < parts->size(); ++i) {
    tracer.trace(contourFrame(image, mask), (*parts)[i], part_contours[i]);
    part_contact_m[i] = silhouette.contactDistance(part_contours[i]);
  }
  for (std::size_t i = 0; i < parts->size(); ++i) measurePart(*parts, i, by_colour);
  return true;
}

/// Where two colours meet, the part with the nearer contact stands in front, and the outline between them is
/// its own. A chord between notches belongs to neither part.
void LocalMapper::Stages::measurePart(const std::vector<ground::Blob>& parts, std::size_t i, bool by_colour) {
  hides.assign(parts.size() + 1, false);
  for (std::size_t k = 0; k < parts.size(); ++k)
    hides[k + 1] = k != i && (!by_colour || part_contact_m[k] < part_contact_m[i]);
  const bool is_object = silhouette.measure(parts[i], part_contours[i], hides, object);
  if (is_object && silhouette.isLine()) return;
  keep(is_object, parts[i]);
}

/// Adds the region just measured as an object, or only as an obstacle of the scan.
void LocalMapper::Stages::keep(bool is_object, const ground::Blob& blob) {
  if (is_object) {
    constexpr float kRoughly = 15.0f;  // multiple of the σ of an outline that is mostly inferred
    if (segmenter.isRough(blob)) {
      for (float& sigma : object.supports.sigma_m) sigma *= kRoughly;  // negative where there is none
    }
    const std::size_t n = map.objects.size();
    object.label = static_cast<std::uint16_t>(n + 1);
    blob_of_object.push_back(n);
    if (spare_objects.empty()) spare_objects.emplace_back();
    map.objects.push_back(std::move(spare_objects.back()));
    spare_objects.pop_back();
    map.objects.back() = object;
    if (contours.size() <= n) contours.emplace_back();
    contours[n] = silhouette.floorContour();
    if (object_blobs.size() <= n) object_blobs.emplace_back();
    object_blobs[n] = blob;
  }
  scan.add(silhouette.floorContour(), is_object ? object.label : std::uint16_t{0});
}

const std::vector<ground::Blob>& LocalMapper::labelledBlobs() const {
  static const std::vector<ground::Blob> kNone;
  return stages_->labelled != nullptr ? *stages_->labelled : kNone;
}
const std::vector<ground::Blob>& LocalMapper::connectedBlobs() const {
  static const std::vector<ground::Blob> kNone;
  return stages_->blobs != nullptr ? *stages_->blobs : kNone;
}
const std::vector<FloorContour>& LocalMapper::floorContours() const {
  return stages_->contours;
}
const lens::Camera& LocalMapper::camera() const {
  return stages_->camera;
}
std::size_t LocalMapper::rejectedPoints() const {
  return stages_->silhouette.rejected() + stages_->flow.rejected();
}

const std::vector<Eigen::Vector2d>& LocalMapper::undecided() const {
  return stages_->undecided_m;
}

double LocalMapper::freeShare() const {
  return stages_->scan.freeShare();
}

double LocalMapper::occludedShare() const {
  return watch_->occlusion.share();
}

double LocalMapper::litBeyondLens() const {
  return stages_->check.litBeyondLens();
}

double LocalMapper::bare_m() const {
  return stages_->occlusion.bare_m();
}

double LocalMapper::gap_s() const {
  return stages_->check.gap_s();
}

const FrameFault& LocalMapper::fault() const {
  return stages_->fault;
}

}  // namespace omnifleet::local_mapper
