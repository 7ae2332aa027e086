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
