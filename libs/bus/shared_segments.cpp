#include "bus/shared_segments.h"

#include <sys/mman.h>

#include <cstdio>
#include <fstream>
#include <string>

namespace omnifleet::bus {
namespace {

struct Range {
  std::uintptr_t begin = 0, end = 0;
};

/// The shared mapping of this process that holds `address`; empty when there is none.
Range sharedMappingOf(std::uintptr_t address) {
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    unsigned long begin = 0, end = 0;
    char access[5] = {};
    if (std::sscanf(line.c_str(), "%lx-%lx %4s", &begin, &end, access) != 3) continue;
    if (begin <= address && address < end) return access[3] == 's' ? Range{begin, end} : Range{};
  }
  return {};
}

bool holds(const std::uint8_t* begin, std::size_t bytes, const std::uint8_t* address) {
  return begin <= address && address < begin + bytes;
}

}  // namespace

SharedSegments::~SharedSegments() {
  clear();
}

const std::uint8_t* SharedSegments::keep(const std::uint8_t* address) {
  for (const Segment& segment : segments_) {
    if (holds(segment.dds_begin, segment.bytes, address))
      return segment.own_begin + (address - segment.dds_begin);
  }
  const Range range = sharedMappingOf(reinterpret_cast<std::uintptr_t>(address));
  if (range.end == 0) return nullptr;
  // mremap(2) with an old size of 0 keeps the shared mapping and makes a second mapping of the same pages.
  void* own = ::mremap(reinterpret_cast<void*>(range.begin), 0, range.end - range.begin, MREMAP_MAYMOVE);
  if (own == MAP_FAILED) return nullptr;
  segments_.push_back({reinterpret_cast<const std::uint8_t*>(range.begin),
                       static_cast<const std::uint8_t*>(own), range.end - range.begin});
  return segments_.back().own_begin + (address - segments_.back().dds_begin);
}

void SharedSegments::clear() {
  for (const Segment& segment : segments_)
    ::munmap(const_cast<std::uint8_t*>(segment.own_begin), segment.bytes);
  segments_.clear();
}

}  // namespace omnifleet::bus
