#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace omnifleet::bus {

/// Second mappings of the shared memory that writers' samples lie in. DDS unmaps a writer's segment as soon
/// as the writer is gone, loans or not (reading a held frame then was a SIGSEGV); these stay until clear() or
/// the end.
class SharedSegments {
 public:
  SharedSegments() = default;
  ~SharedSegments();
  SharedSegments(const SharedSegments&) = delete;
  SharedSegments& operator=(const SharedSegments&) = delete;

  /// The same byte in our own mapping of its segment, made at first sight. nullptr when `address` is in no
  /// shared file mapping. Costs a look at a short list; /proc/self/maps is read for new segments only.
  const std::uint8_t* keep(const std::uint8_t* address);

  /// Forgets all. For when the writer has changed: the same address may now be another segment.
  void clear();
  std::size_t size() const { return segments_.size(); }

 private:
  struct Segment {
    const std::uint8_t* theirs;
    const std::uint8_t* ours;
    std::size_t bytes;
  };
  std::vector<Segment> segments_;
};

}  // namespace omnifleet::bus
