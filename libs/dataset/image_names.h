#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace omnifleet::dataset {

/// Extensions of the image files that every stage and tool reads: .png, .jpg, .jpeg, .bmp, .tif, .tiff, .pgm,
/// .ppm.
const std::vector<std::string>& imageExtensions();
/// True if the extension is one of them, in any case.
bool isImageName(const std::filesystem::path& path);
/// "png, jpg, …", for messages.
std::string imageExtensionsText();

}  // namespace omnifleet::dataset
