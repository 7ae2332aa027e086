#pragma once

// Reading comma-separated files row by row; internal to the library.

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "observation/observation.h"

namespace omnifleet::dataset {

/// Strict parsers: the whole field (spaces around it aside), finite, in range. False otherwise.
bool parseTime(std::string_view field, TimeNs& value);
bool parseNumber(std::string_view field, double& value);
/// Seconds with up to nine decimals, exactly ("1000.2" → 1000200000000); also exponents, through double.
bool parseSeconds(std::string_view field, TimeNs& value);
std::string_view trim(std::string_view text);
/// Fields between separators; runs of blanks separate when `separator` is a blank.
void split(std::string_view line, char separator, std::vector<std::string_view>& fields);

/// Calls `row` with the fields of every line that is neither empty nor a comment (#); a byte order mark and
/// CRLF line ends belong to no line. `row` returns an empty
/// string, or what is wrong with the line, which is then added to `warnings` as FILE:LINE: what (left out).
/// Throws options::Error when the file cannot be read, and when it has rows but none is good.
void readRows(const std::string& path, char separator, std::vector<std::string>& warnings,
              const std::function<std::string(const std::vector<std::string_view>&)>& row);

}  // namespace omnifleet::dataset
