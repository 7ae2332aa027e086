#pragma once

#include <CLI/CLI.hpp>
#include <cmath>
#include <string>

#include "options/options.h"

namespace omnifleet::options {

/// Validator of a command line option: a finite number within `allowed`. CLI11's own Range and PositiveNumber
/// accept NaN.
inline CLI::Validator within(Range allowed) {
  const std::string bounds =
      "[" + CLI::detail::to_string(allowed.min) + " - " + CLI::detail::to_string(allowed.max) + "]";
  return {[allowed, bounds](std::string& text) {
            double value = 0.0;
            const bool number = CLI::detail::lexical_cast(text, value) && !std::isnan(value);
            if (number && value >= allowed.min && value <= allowed.max) return std::string();
            return "'" + text + "' is not a number within " + bounds;
          },
          "FLOAT in " + bounds};
}

/// Validator of a command line option: not "", which as a folder would be the root of the file system.
inline CLI::Validator notEmpty() {
  return {[](std::string& text) {
            return text.empty() ? std::string("the value is empty; give a path") : std::string();
          },
          ""};
}

}  // namespace omnifleet::options
