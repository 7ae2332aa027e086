#include "dataset/landmarks.h"

#include <fmt/format.h>

#include <algorithm>

#include "dataset/atomic_file.h"
#include "options/options.h"

namespace omnifleet::dataset {

std::vector<Landmark> readLandmarks(const std::string& path) {
  const options::Section file = options::Section::load(path);
  const options::Section section = file.child("landmarks");
  std::vector<Landmark> landmarks;
  for (const std::string& name : section.keys()) {
    const options::Section entry = section.child(name);
    Landmark landmark;
    landmark.name = name;
    entry.require("position_m", landmark.position_m);
    entry.read("sigma_m", landmark.sigma_m, {1e-4, 10.0});
    entry.finish();
    landmarks.push_back(std::move(landmark));
  }
  file.finish();
  std::sort(landmarks.begin(), landmarks.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  return landmarks;
}

void writeLandmarks(const std::string& path, const std::vector<Landmark>& landmarks) {
  std::string text = "landmarks:\n";
  for (const Landmark& landmark : landmarks) {
    text += fmt::format("  \"{}\": {{position_m: [{}, {}], sigma_m: {}}}\n", landmark.name,
                        landmark.position_m.x(), landmark.position_m.y(), landmark.sigma_m);
  }
  writeAtomic(path, text);
}

}  // namespace omnifleet::dataset
