#pragma once

#include "tests/experiments/plot/plot.h"

namespace omnifleet::choi {

namespace ink = experiments::ink;
using experiments::Axes;
using experiments::beside;
using experiments::Line;
using experiments::Plot;
using experiments::save;
using experiments::stacked;

}  // namespace omnifleet::choi
