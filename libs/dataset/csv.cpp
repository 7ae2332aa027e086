#include "dataset/csv.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "dataset/atomic_file.h"
#include "options/options.h"

namespace omnifleet::dataset {
namespace {
constexpr std::string_view kBlanks = " \t\r";
constexpr TimeNs kSecond_ns = 1000000000;

/// Removes the UTF-8 byte order mark that some spreadsheets and editors write before the first row.
std::string_view withoutByteOrderMark(std::string_view content) {
  constexpr std::string_view kMark = "\xEF\xBB\xBF";
  if (content.substr(0, kMark.size()) == kMark) content.remove_prefix(kMark.size());
  return content;
}
}  // namespace

std::string_view trim(std::string_view text) {
  const std::size_t first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

bool parseTime(std::string_view field, TimeNs& value) {
  field = trim(field);
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  return error == std::errc() && end == field.data() + field.size() && !field.empty();
}

bool parseNumber(std::string_view field, double& value) {
  field = trim(field);
  if (!field.empty() && field.front() == '+') field.remove_prefix(1);
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  return error == std::errc() && end == field.data() + field.size() && !field.empty() && std::isfinite(value);
}

bool parseSeconds(std::string_view field, TimeNs& value) {
  field = trim(field);
  double seconds = 0.0;
  if (!parseNumber(field, seconds) || std::abs(seconds) > 9e9) return false;
  const std::size_t dot = field.find('.');
  const std::string_view whole = field.substr(0, dot);
  const std::string_view decimals =
      dot == std::string_view::npos ? std::string_view() : field.substr(dot + 1);
  const bool plain = field.find_first_not_of("0123456789.") == std::string_view::npos && !whole.empty();
  if (!plain || decimals.size() > 9) {
    value = static_cast<TimeNs>(std::llround(seconds * 1e9));
    return true;
  }
  TimeNs whole_s = 0, part = 0;
  if (!parseTime(whole, whole_s) || (!decimals.empty() && !parseTime(decimals, part))) return false;
  for (std::size_t i = decimals.size(); i < 9; ++i) part *= 10;
  value = whole_s * kSecond_ns + part;
  return true;
}

void split(std::string_view line, char separator, std::vector<std::string_view>& fields) {
  fields.clear();
  const bool blank = separator == ' ';
  while (true) {
    if (blank) line = trim(line);
    const std::size_t end = blank ? line.find_first_of(kBlanks) : line.find(separator);
    const std::string_view field = trim(line.substr(0, end));
    if (!blank || !field.empty()) fields.push_back(field);
    if (end == std::string_view::npos) return;
    line.remove_prefix(end + 1);
  }
}

void readRows(const std::string& path, char separator, std::vector<std::string>& warnings,
              const std::function<std::string(const std::vector<std::string_view>&)>& row) {
  std::string content;
  try {
    content = readFile(path);
  } catch (const std::runtime_error& error) {
    throw options::Error(error.what());
  }
  std::vector<std::string_view> fields;
  std::string_view rest = withoutByteOrderMark(content);
  std::string first_problem;
  bool any_good = false;
  for (int line_number = 1; !rest.empty(); ++line_number) {
    const std::size_t end = rest.find('\n');
    const std::string_view line = trim(rest.substr(0, end));
    rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
    if (line.empty() || line.front() == '#') continue;
    split(line, separator, fields);
    const std::string problem = row(fields);
    any_good = any_good || problem.empty();
    if (problem.empty()) continue;
    warnings.push_back(fmt::format("{}:{}: {} (row ignored)", path, line_number, problem));
    if (first_problem.empty()) first_problem = fmt::format("{}:{}: {}", path, line_number, problem);
  }
  if (!any_good && !first_problem.empty()) {
    throw options::Error(first_problem + "; no row of this file is usable; correct it or remove the file");
  }
}

}  // namespace omnifleet::dataset
