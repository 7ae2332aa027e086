#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace omnifleet::bus {

// Names in /dev/shm. Fast DDS 2.9: `fast_datasharing_<GUID prefix>_<entity>` (no lock), `fastrtps_<id>` and
// `fastrtps_port<N>` (locks: _el exclusive, _sl shared; mutex: sem.<name>_mutex).
inline const std::string kDataSharingFile = "fast_datasharing_";
inline const std::string kTransportFile = "fastrtps_";
inline const std::string kOwnerFile =
    "omnifleet_owner_";  ///< + the first 8 bytes of the GUID: SharedMemoryOwner
inline const std::string kFleetFile = "omnifleet_fleet_";  ///< + a random name: SharedMemoryReservation

bool startsWith(const std::string& text, const std::string& prefix);
bool isDdsName(const std::string& name);
/// "…_el", "…_sl".
bool isLockName(const std::string& name);
/// First 8 bytes of the GUID in the name of a data-sharing file, "01.0f.78.fd.51.1a.90.de"; else empty. Two
/// bytes name the vendor, two the host, two are of the process number, two are random.
std::string prefixIn(const std::string& name);

/// Sorted; empty when the folder cannot be read.
std::vector<std::string> namesIn(const std::string& directory);
std::string firstLine(const std::string& path);
/// The file has been there for 2 s.
bool isSettled(const std::string& path);
/// 16 hexadecimal digits.
std::string randomName();
/// "1 DDS file", "3 DDS files".
std::string counted(std::size_t number, const std::string& noun);

/// Text of a SharedMemoryReservation.
struct FleetRecord {
  std::size_t bytes = 0;
  std::string out;
  std::string text() const;
  /// An unreadable file has an empty `out`.
  static FleetRecord read(const std::string& path);
};

}  // namespace omnifleet::bus
