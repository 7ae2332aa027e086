#pragma once

#include <cstdlib>
#include <string>

namespace omnifleet::markers {

/// Folder of other people's data; tests skip where it is missing.
inline std::string dataFolder() {
  if (const char* folder = std::getenv("OMNIFLEET_DATA")) return folder;
  const char* source = std::getenv("OMNIFLEET_SOURCE_DIR");
  return std::string(source != nullptr ? source : ".") + "/../shared/data";
}

/// Folder of the project's sources.
inline std::string sourceFolder() {
  const char* source = std::getenv("OMNIFLEET_SOURCE_DIR");
  return source != nullptr ? source : ".";
}

}  // namespace omnifleet::markers
