#pragma once

#include <string>

#include "bus/qos.h"

namespace omnifleet::bus {

/// A topic: its DDS name, its generated type T, and its QoS. `topics.h` holds all of them.
template <class T>
struct Topic {
  using Type = T;
  std::string name;
  QosProfile qos;
};

}  // namespace omnifleet::bus
