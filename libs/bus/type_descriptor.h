#pragma once

#include <memory>
#include <string>

// Only the bus's own sources see more of DDS than this name.
namespace eprosima::fastdds::dds {
class TopicDataType;
}

namespace omnifleet::bus {

/// What a bus has to know of a generated type in order to carry it without naming it.
struct TypeDescriptor {
  std::string name;      ///< as on the wire, e.g. "omnifleet::v1::LocalMap"
  std::string idl_hash;  ///< SHA-256 (hex) of the IDL text it was generated from, includes included
  std::shared_ptr<void> (*create)();         ///< a new default sample, on the heap
  void (*copy)(void* to, const void* from);  ///< assignment
  std::string (*key)(
      const void* sample);  ///< value of the key fields as bytes; empty for types without a key
  eprosima::fastdds::dds::TopicDataType* (*support)();  ///< a new DDS type support; the caller owns it
};

/// The descriptor of a generated type; specialised in types.cpp for every type that `topics.h` declares.
template <class T>
const TypeDescriptor& describe();

}  // namespace omnifleet::bus
