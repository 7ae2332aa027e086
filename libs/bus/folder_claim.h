#pragma once

#include <string>

namespace omnifleet::bus {

/// Marks a run directory as used. Two fleets with one run directory would mix their files. The mark is a lock
/// (flock(2)) on OUT/.claim, which the kernel frees when the process ends; on a network file system it also
/// holds between machines. Parts of one fleet for different hosts may share a directory: each also locks
/// OUT/.claim_<host>.
class FolderClaim {
 public:
  /// @param folder exists and is writable
  /// @param fleet the fleet file or recording, for messages; parts that share the folder must have the same
  /// @param host the started part of the fleet; empty: the whole fleet
  /// Throws options::Error when another fleet, or the same part, uses the folder. A file system without locks
  /// gives no protection.
  FolderClaim(const std::string& folder, const std::string& fleet, const std::string& host);
  /// Removes the files.
  ~FolderClaim();
  FolderClaim(const FolderClaim&) = delete;
  FolderClaim& operator=(const FolderClaim&) = delete;

 private:
  /// @return the descriptor; −1: somebody else holds the lock
  static int lock(const std::string& path, int kind);
  void claimPart(const std::string& folder, const std::string& fleet, const std::string& host);

  std::string path_, part_path_;
  int file_ = -1, part_ = -1;
};

}  // namespace omnifleet::bus
