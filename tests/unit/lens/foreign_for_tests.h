#pragma once

#include <fstream>
#include <string>

#include "lens/camera.h"
#include "tests/test_data.h"

namespace omnifleet::lens::test {

/// Loads a sensor.yaml that stands beside a calibration file, as users have them.
struct Loaded {
  CameraModel model;
  std::string refusal;  ///< empty: the file was read
};

inline Loaded loadText(const omnifleet::test::TempFolder& folder, const std::string& sensor,
                       const std::string& calibration, const std::string& name = "cal.yml") {
  if (!calibration.empty()) std::ofstream(folder / name) << calibration;
  std::ofstream(folder / "sensor.yaml") << sensor;
  Loaded loaded;
  try {
    loaded.model = CameraModel::load(folder / "sensor.yaml");
  } catch (const options::Error& error) {
    loaded.refusal = error.what();
  }
  return loaded;
}

}  // namespace omnifleet::lens::test
