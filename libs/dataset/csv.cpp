#include "dataset/csv.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <fstream>
#include <map>
#include <optional>

#include "dataset/atomic_file.h"
#include "options/options.h"

namespace omnifleet::dataset {
namespace {
constexpr std::string_view kBlanks = " \t\r";

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

namespace {

/// Parses a number of a unit that has 10^digits nanoseconds. Exact with up to `digits` decimals.
bool parseScaled(std::string_view field, std::size_t digits, TimeNs& value) {
  field = trim(field);
  const double scale = std::pow(10.0, static_cast<double>(digits));
  double number = 0.0;
  if (!parseNumber(field, number) || std::abs(number) * scale > 9e18) return false;
  const std::size_t dot = field.find('.');
  const std::string_view whole = field.substr(0, dot);
  const std::string_view decimals =
      dot == std::string_view::npos ? std::string_view() : field.substr(dot + 1);
  const bool plain = field.find_first_not_of("0123456789.") == std::string_view::npos && !whole.empty();
  if (!plain || decimals.size() > digits) {
    value = static_cast<TimeNs>(std::llround(number * scale));
    return true;
  }
  TimeNs whole_units = 0, part_ns = 0;
  if (!parseTime(whole, whole_units) || (!decimals.empty() && !parseTime(decimals, part_ns))) return false;
  for (std::size_t i = decimals.size(); i < digits; ++i) part_ns *= 10;
  value = whole_units * static_cast<TimeNs>(scale) + part_ns;
  return true;
}

/// The unit in a header line: "us" of "#timestamp [us],filename". Empty: not such a line.
std::string_view unitIn(std::string_view line) {
  line = trim(line);
  while (!line.empty() && line.front() == '#') line.remove_prefix(1);
  line = trim(line);
  for (const std::string_view word : {"timestamps", "timestamp", "time", "stamp", "t"}) {
    if (line.substr(0, word.size()) != word) continue;
    const std::string_view rest = trim(line.substr(word.size()));
    const std::size_t end = rest.find(']');
    return rest.empty() || rest.front() != '[' || end == std::string_view::npos
               ? std::string_view()
               : trim(rest.substr(1, end - 1));
  }
  return {};
}

/// Decimals of the unit that make a nanosecond; empty: unknown unit.
std::optional<int> digitsOf(std::string_view unit) {
  constexpr int kNano = 0, kMicro = 3, kMilli = 6, kOne = 9;
  static const std::map<std::string_view, int> kUnits{
      {"ns", kNano},  {"nsec", kNano},  {"nanoseconds", kNano},   {"us", kMicro},
      {"µs", kMicro}, {"μs", kMicro},   {"usec", kMicro},         {"microseconds", kMicro},
      {"ms", kMilli}, {"msec", kMilli}, {"milliseconds", kMilli}, {"s", kOne},
      {"sec", kOne},  {"seconds", kOne}};
  const auto found = kUnits.find(unit);
  return found == kUnits.end() ? std::nullopt : std::optional(found->second);
}

}  // namespace

bool parseSeconds(std::string_view field, TimeNs& value) {
  constexpr std::size_t kDigits = 9;
  return parseScaled(field, kDigits, value);
}

TimeColumn::TimeColumn(const std::string& path) {
  std::ifstream file(path);
  std::string text;
  for (int number = 1; std::getline(file, text); ++number) {
    const std::string_view line = trim(number == 1 ? withoutByteOrderMark(text) : std::string_view(text));
    const std::string_view unit = unitIn(line);
    if (!unit.empty()) {
      const std::optional<int> digits = digitsOf(unit);
      if (!digits)
        throw options::Error(
            fmt::format("{}:{}: the time unit [{}] is not known; write ns, us, ms or s", path, number, unit));
      digits_ = *digits;
      return;
    }
    if (!line.empty() && line.front() != '#') return;  // rows
  }
}

bool TimeColumn::parse(std::string_view field, TimeNs& value) const {
  const bool parsed =
      digits_ == 0 ? parseTime(field, value) : parseScaled(field, static_cast<std::size_t>(digits_), value);
  return parsed && value >= 0;
}

std::string TimeColumn::rule() const {
  return digits_ == 0 ? "the timestamp must be a whole number of nanoseconds ≥ 0"
                      : "the timestamp must be a number ≥ 0 of the unit in the header";
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
