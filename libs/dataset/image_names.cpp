#include "dataset/image_names.h"

#include <algorithm>
#include <cctype>

namespace omnifleet::dataset {

const std::vector<std::string>& imageExtensions() {
  static const std::vector<std::string> kAll{".png", ".jpg",  ".jpeg", ".bmp",
                                             ".tif", ".tiff", ".pgm",  ".ppm"};
  return kAll;
}

bool isImageName(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return std::find(imageExtensions().begin(), imageExtensions().end(), extension) != imageExtensions().end();
}

std::string imageExtensionsText() {
  std::string text;
  for (const std::string& extension : imageExtensions())
    text += (text.empty() ? "" : ", ") + extension.substr(1);
  return text;
}

}  // namespace omnifleet::dataset
