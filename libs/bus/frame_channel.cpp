#include "bus/frame_channel.h"

#include <stdexcept>
#include <tuple>
#include <type_traits>
#include <utility>

#include "idl/camera.h"

namespace omnifleet::bus {
namespace {

template <class Frame>
constexpr std::size_t capacityOf() {
  return std::tuple_size<std::decay_t<decltype(std::declval<const Frame&>().data())>>::value;
}

}  // namespace

FrameClass frameClassFor(std::size_t bytes_needed) {
  for (const FrameClass& frame_class :
       {FrameClass{"Frame1M", capacityOf<v1::Frame1M>()}, FrameClass{"Frame4M", capacityOf<v1::Frame4M>()},
        FrameClass{"Frame12M", capacityOf<v1::Frame12M>()}}) {
    if (bytes_needed <= frame_class.capacity) return frame_class;
  }
  throw std::runtime_error("a frame of " + std::to_string(bytes_needed) +
                           " bytes is larger than the largest frame class (" +
                           std::to_string(capacityOf<v1::Frame12M>()) + ")");
}

}  // namespace omnifleet::bus
