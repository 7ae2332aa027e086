#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace omnifleet::bus {

/// Second mappings of the shared memory that holds a writer's samples. DDS unmaps the segment of a writer as
/// soon as the writer is gone, even with open loans (SIGSEGV when a held frame was read). These mappings stay
/// until clear() or destruction.
class SharedSegments {
 public:
  SharedSegments() = default;
  ~SharedSegments();
  SharedSegments(const SharedSegments&) = delete;
  SharedSegments& operator=(const SharedSegments&) = delete;

  /// The same byte in a second mapping of its segment, which is created at first use. nullptr when `address`
  /// is not in a shared file mapping. Known segments cost a search in a short list; only new ones read
  /// /proc/self/maps.
  const std::uint8_t* keep(const std::uint8_t* address);

  /// Removes all mappings. Call when the writer has changed: the same address may belong to another segment.
  void clear();
  std::size_t size() const { return segments_.size(); }

 private:
  struct Segment {
    const std::uint8_t* dds_begin;
    const std::uint8_t* own_begin;
    std::size_t bytes;
  };
  std::vector<Segment> segments_;
};

}  // namespace omnifleet::bus
