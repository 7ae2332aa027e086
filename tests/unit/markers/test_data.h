#pragma once

#include <cstdlib>
#include <string>

namespace omnifleet::markers {

/// Folder of the external test data. Tests skip if it does not exist.
inline std::string dataFolder() {
  if (const char* folder = std::getenv("OMNIFLEET_DATA")) return folder;
  const char* source = std::getenv("OMNIFLEET_SOURCE_DIR");
  return std::string(source != nullptr ? source : ".") + "/../shared/data";
}

/// Source folder of the project.
inline std::string sourceFolder() {
  const char* source = std::getenv("OMNIFLEET_SOURCE_DIR");
  return source != nullptr ? source : ".";
}

}  // namespace omnifleet::markers
