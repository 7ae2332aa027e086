#pragma once

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdlib>
#include <string>

#include "options/options.h"

namespace omnifleet::options {

/// `text` in quotes. CLI11 reports the value of an environment variable as that of its option: names the
/// variable if it holds this text.
inline std::string quotedValue(const std::string& text, const char* variable) {
  const char* value = variable != nullptr ? std::getenv(variable) : nullptr;
  const bool is_from_variable = value != nullptr && text == value;
  return "'" + text + "'" +
         (is_from_variable ? " (from the environment variable " + std::string(variable) + ")" : "");
}

/// Validator of a command line option: a finite number within `allowed`. CLI11's own Range and PositiveNumber
/// accept NaN. @param variable environment variable of the option, if it has one
inline CLI::Validator within(Range allowed, const char* variable = nullptr) {
  const std::string bounds =
      "[" + CLI::detail::to_string(allowed.min) + " - " + CLI::detail::to_string(allowed.max) + "]";
  return {[allowed, bounds, variable](std::string& text) {
            double value = 0.0;
            const bool number = CLI::detail::lexical_cast(text, value) && !std::isnan(value);
            if (number && value >= allowed.min && value <= allowed.max) return std::string();
            return quotedValue(text, variable) + " is not a number within " + bounds;
          },
          "FLOAT in " + bounds};
}

/// Validator of --domain: a whole number within [0, 232], also from OMNIFLEET_DOMAIN.
inline CLI::Validator domainNumber() {
  return {[](std::string& text) {
            int value = -1;
            constexpr int kLargest = 232;
            if (CLI::detail::lexical_cast(text, value) && value >= 0 && value <= kLargest)
              return std::string();
            return quotedValue(text, "OMNIFLEET_DOMAIN") + " is not a whole number within [0, 232]";
          },
          "INT in [0 - 232]"};
}

/// Validator of a command line option: not "", which as a folder would be the root of the file system.
inline CLI::Validator notEmpty() {
  return {[](std::string& text) {
            return text.empty() ? std::string("the value is empty; give a path") : std::string();
          },
          ""};
}

}  // namespace omnifleet::options
