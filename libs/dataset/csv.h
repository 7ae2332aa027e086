#pragma once

// Reads comma-separated files row by row. Internal to the library.

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "observation/observation.h"

namespace omnifleet::dataset {

/// Strict parsers: the whole field (without surrounding blanks) must be finite and in range. False otherwise.
bool parseTime(std::string_view field, TimeNs& value);
bool parseNumber(std::string_view field, double& value);
/// Parses seconds with up to nine decimals exactly ("1000.2" → 1000200000000). Exponents are parsed as
/// double.
bool parseSeconds(std::string_view field, TimeNs& value);

/// The first column of a file: times in the unit that the header states, "#timestamp [us],…".
class TimeColumn {
 public:
  /// Reads the header of the file; nanoseconds without one. Throws options::Error for a unit other than ns,
  /// us, ms and s.
  explicit TimeColumn(const std::string& path);

  /// A time as nanoseconds. Nanoseconds must be a whole number, other units may have decimals. Recordings do
  /// not begin before the epoch of their clock, so a negative time is a corrupt number. @return false for
  /// what is no such time
  bool parse(std::string_view field, TimeNs& value) const;
  /// What parse() demands, for a message.
  std::string rule() const;

 private:
  int digits_ = 0;  ///< decimals of the unit that make a nanosecond: 0, 3, 6 or 9
};

std::string_view trim(std::string_view text);
/// Splits a line into fields. If `separator` is a blank, several blanks count as one.
void split(std::string_view line, char separator, std::vector<std::string_view>& fields);

/// Calls `row` with the fields of every line that is neither empty nor a comment (#). A byte order mark and
/// CRLF line ends are removed. `row` returns an empty string or a description of the problem. Problems are
/// added to `warnings` as "FILE:LINE: problem (row ignored)". Throws options::Error when the file cannot be
/// read, or when it has rows but none is valid.
void readRows(const std::string& path, char separator, std::vector<std::string>& warnings,
              const std::function<std::string(const std::vector<std::string_view>&)>& row);

}  // namespace omnifleet::dataset
