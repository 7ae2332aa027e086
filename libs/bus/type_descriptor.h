#pragma once

#include <cstddef>
#include <memory>
#include <string>

// Outside the sources of the bus, this name is all of DDS that is visible.
namespace eprosima::fastdds::dds {
class TopicDataType;
}

namespace omnifleet::bus {

/// The properties of a generated type that a bus needs to carry it without naming it.
struct TypeDescriptor {
  std::string name;                          ///< type name in DDS, e.g. "omnifleet::v1::LocalMap"
  std::string idl_hash;                      ///< SHA-256 (hex) of the IDL text of the type, with its includes
  std::shared_ptr<void> (*create)();         ///< a new default sample, on the heap
  void (*copy)(void* to, const void* from);  ///< assignment
  std::string (*key)(
      const void* sample);  ///< value of the key fields as bytes; empty for types without a key
  std::size_t (*size)(const void* sample);              ///< bytes of the serialized sample
  eprosima::fastdds::dds::TopicDataType* (*support)();  ///< a new DDS type support; the caller owns it
};

/// The descriptor of a generated type; specialised in types.cpp for every type that `topics.h` declares.
template <class T>
const TypeDescriptor& describe();

}  // namespace omnifleet::bus
