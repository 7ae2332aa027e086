#pragma once

// Calibration files of other programs. Each format has a reader that returns a ForeignLens; foreign_model.cpp
// alone turns it into a CameraModel.

#include <yaml-cpp/yaml.h>

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "lens/camera.h"

namespace omnifleet::lens {

/// A text file as a tree of keys: YAML, JSON, or OpenCV's XML. Files in formats without keys have no tree.
struct Document {
  std::string path;
  std::string text;        ///< without byte order mark
  YAML::Node root;         ///< a map; anything else if the file has no keys
  std::string yaml_error;  ///< "LINE: problem" if the text is neither YAML nor JSON; otherwise empty

  bool isMap() const { return root.IsDefined() && root.IsMap(); }
  /// `path:line` of a node or of its key; `path` if the line is unknown (XML).
  std::string place(const YAML::Node& node) const;
};

/// Reads and parses a file. Throws options::Error if it cannot be read, or is XML that OpenCV cannot read.
Document readDocument(const std::string& path);

/// The numbers of a list, of a list of rows, or of a matrix {rows, cols, data}. Throws options::Error that
/// names file, line and key.
std::vector<double> numbersOf(const Document& document, const YAML::Node& node, const std::string& key);
/// Text of a scalar. Throws options::Error for a list or a map.
std::string textOf(const Document& document, const YAML::Node& node, const std::string& key);
/// Throws options::Error for a key that stands twice in one map; yaml-cpp would return the first of them.
void rejectRepeatedKeys(const Document& document, const YAML::Node& node);
/// Lower case, without `_`, `-` and blanks: camera_matrix, Camera_Matrix and cameraMatrix are one key.
std::string normalized(const std::string& key);

/// The families of lens models that calibration files state.
enum class Family { kPinhole, kFisheye, kOcam };
std::string familyName(Family family);  ///< as a value of `camera_model` or `projection`

/// What a calibration file says, in one form for all formats.
struct ForeignLens {
  std::string path;
  std::string format;               ///< "OpenCV", "ROS camera_info", …, for messages
  std::optional<Family> family;     ///< empty: the file states no lens model
  std::string stated_by;            ///< key and value that state the family, for messages
  int width_px = 0, height_px = 0;  ///< 0: the file does not state the image size
  Eigen::Vector2d focal_px{0.0, 0.0};
  Eigen::Vector2d principal_point_px{0.0, 0.0};
  double skew_px = 0.0;            ///< K[0][1]
  std::vector<double> distortion;  ///< in the order of CameraModel::distortion
};

/// What kind of file this is, by its keys (files without keys: by the form of their lines).
enum class FileKind {
  kOwn,     ///< a sensor.yaml, or no calibration at all
  kMatrix,  ///< camera matrix and distortion: OpenCV, ROS
  kKalibr,  ///< camchain with cam0, cam1, …, or one camera in the same terms (ASL/EuRoC)
  kOcamCalib,
  kOther  ///< known, but not read; see otherFormat()
};
FileKind kindOf(const Document& document);

/// Reads the lens of a document. `keys` filters the keys of the top level; `camera` chooses one of several
/// cameras
/// ("": the only one). Throws options::Error that names file, line, key and what to do: for each key that is
/// neither used nor irrelevant to the lens, for an unknown model, for a format that is known but not read.
ForeignLens readForeign(const Document& document, FileKind kind, const std::string& camera);

ForeignLens readMatrixFile(const Document& document);
ForeignLens readKalibr(const Document& document, const std::string& camera);
ForeignLens readOcamCalib(const Document& document);
bool isMatrixFile(const Document& document);
bool isKalibr(const Document& document);
bool isOcamCalib(const Document& document);

/// Name of a format that is recognised but not read, with what to do. Empty if the document has none of them.
std::string otherFormat(const Document& document);

/// The family that a name of a distortion or camera model stands for. Empty: unknown.
std::optional<Family> familyFromName(const std::string& name);
/// Throws options::Error that lists the known names.
[[noreturn]] void failUnknownModel(const std::string& place, const std::string& key, const std::string& name);

/// Keys of sensor.yaml that may stand beside the keys of another program.
bool isOwnKey(const std::string& key, const YAML::Node& value);

/// A sensor.yaml: its own keys, and the lens if the file is also a calibration file of another program.
struct SensorFile {
  options::Section own;
  std::optional<ForeignLens> lens;
};
SensorFile readSensorFile(const std::string& path);
/// The file that `calibration:` names. Throws options::Error if it is no calibration file of another program.
ForeignLens readCalibrationFile(const options::Section& section, const std::string& name);

/// Puts size, model and numbers of the lens into `model`. The user's `camera_model` and `projection` decide
/// if the file states no model. Throws options::Error if neither states it, or if file and user contradict
/// each other.
void applyForeign(const options::Section& section, const ForeignLens& lens, CameraModel& model);

/// Throws options::Error ("key: problem") for numbers that are possible, but make no sense for their image: a
/// principal point outside of it, ocam values in another order.
void checkPlausibleNumbers(const CameraModel& model);
/// The same for the view of the lens: an image circle of a few pixels, an image of a few degrees, a model
/// that ends inside the image.
/// @param fov_is_stated false if fov_deg is what the model can be inverted over
void checkPlausibleView(const CameraModel& model, bool fov_is_stated);

}  // namespace omnifleet::lens
