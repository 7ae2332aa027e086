#include "local_mapper/local_mapper.h"

namespace omnifleet::local_mapper {

Options Options::read(const options::Section& section) {
  Options o;
  o.check = FrameCheckOptions::read(section.child("frame"));
  o.view = ground::ViewOptions::read(section.child("view"));
  o.ground = ground::SegmenterOptions::read(section.child("ground"));
  o.connection = ground::ConnectionOptions::read(section.child("connection"));
  o.contour = ground::ContourOptions::read(section.child("contour"));
  o.silhouette = SilhouetteOptions::read(section.child("silhouette"));
  o.scan = ScanOptions::read(section.child("scan"));
  o.flow = flow::FeatureFlowOptions::read(section.child("flow"));
  section.finish();
  return o;
}

/// The steps of §III in their order, with the buffers that live from frame to frame.
struct LocalMapper::Stages {
  Stages(const lens::Camera& c, const Options& o)
      : options(o),
        camera(c),
        view(camera, o.view),
        check(camera.model(), view, o.check),
        segmenter(camera, view, o.ground),
        connection(o.connection),
        tracer(view, o.contour),
        silhouette(camera, view, o.silhouette),
        scan(camera, view, o.scan),
        flow(camera, o.flow) {}
  Stages(const Stages&) = delete;  // the steps refer to camera and view
  Stages& operator=(const Stages&) = delete;

  void begin(const Frame& frame, const Motion& wheels);
  bool findRegions(const cv::Mat& image);
  void measureObjects(const cv::Mat& image);

  Options options;
  lens::Camera camera;
  ground::FloorView view;
  FrameCheck check;
  ground::GroundSegmenter segmenter;
  ground::Labeller labeller;
  ground::RegionConnection connection;
  ground::ContourTracer tracer;
  Silhouette silhouette;
  FloorScan scan;
  flow::FeatureFlow flow;

  const std::vector<ground::Blob>* labelled = nullptr;
  const std::vector<ground::Blob>* blobs = nullptr;
  std::vector<std::size_t> blob_of_object;
  std::vector<FloorContour> contours;  // of the objects, kept for reuse of their buffers
  ground::Contour contour;
  ObjectObservation object;
  LocalMap map;
};

LocalMapper::LocalMapper(const lens::Camera& camera, const Options& options)
    : stages_(std::make_unique<Stages>(camera, options)) {}
LocalMapper::~LocalMapper() = default;
LocalMapper::LocalMapper(LocalMapper&&) noexcept = default;
LocalMapper& LocalMapper::operator=(LocalMapper&&) noexcept = default;

const LocalMap& LocalMapper::process(const Frame& frame, const Motion& wheels) {
  Stages& s = *stages_;
  s.begin(frame, wheels);
  s.map.state = s.check.check(frame);
  if (s.map.state == FrameState::kOk && !s.findRegions(frame.image))
    s.map.state = FrameState::kDark;  // no floor
  if (!s.check.follows() || s.map.state != FrameState::kOk) s.flow.forget();
  if (s.map.state != FrameState::kOk) return s.map;
  s.flow.push(frame.image);       // §III.3: pyramid
  s.measureObjects(frame.image);  // §III.4–5: outline on the floor, hull, scan
  s.flow.track(*s.blobs, s.blob_of_object, wheels, s.map.objects);  // eq. 2–7 and the filter of §III.5
  return s.map;
}

void LocalMapper::Stages::begin(const Frame& frame, const Motion& wheels) {
  map.acquired_ns = frame.acquired_ns;
  map.sequence = frame.sequence;
  map.camera_height_m = camera.height();
  map.motion = wheels;
  map.objects.clear();
  map.scan.range_m.clear();
  map.scan.sigma_m.clear();
  map.scan.label.clear();
  map.scan.object.clear();
}

bool LocalMapper::Stages::findRegions(const cv::Mat& image) {
  if (!segmenter.segment(image)) return false;  // §III.2: ground removed by its histogram
  labelled = &labeller.label(segmenter.objects(), segmenter.strips(), options.silhouette.min_area_px);
  blobs = &connection.connect(*labelled);  // Algorithm 1
  return true;
}

void LocalMapper::Stages::measureObjects(const cv::Mat& image) {
  blob_of_object.clear();
  scan.begin();
  for (std::size_t n = 0; n < blobs->size(); ++n) {
    const auto& blob = (*blobs)[n];
    tracer.trace({image, flow.grey(), segmenter.objects(), segmenter.floorColour()}, blob, contour);
    const bool is_object = silhouette.measure(blob, contour, object);
    if (is_object) {
      object.label = static_cast<std::uint16_t>(blob_of_object.size() + 1);
      blob_of_object.push_back(n);
      map.objects.push_back(object);
      if (contours.size() < map.objects.size()) contours.emplace_back();
      contours[map.objects.size() - 1] = silhouette.floorContour();
    }
    scan.add(silhouette.floorContour(), is_object ? object.label : std::uint16_t{0});
  }
  scan.finish(map.scan);
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

}  // namespace omnifleet::local_mapper
