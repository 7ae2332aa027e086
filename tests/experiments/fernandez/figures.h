#pragma once

#include <string>

#include "tests/experiments/fernandez/study.h"

namespace omnifleet::fernandez {

/// Figs. 4 and 5: the true path in its room, with the furniture, from the ground truth of a recording.
void drawPath(const std::string& recording, const StudyResult& study, int set, const std::string& file);

/// Figs. 6 and 7: maps of k1 = k2 = 64 over the truth, scaled, turned and moved onto it.
void drawMaps(const StudyResult& study, int set, const std::string& file);

/// Figs. 8 and 9: shape difference over k1 and k2, one table per step. @param method as nameOf()
void drawShape(const StudyResult& study, const std::string& method, int set, const std::string& file);

/// Figs. 10 and 11: time to build the map over k1 and k2, steps 1 and 2; one row per method.
void drawTime(const StudyResult& study, int set, const std::string& file);

}  // namespace omnifleet::fernandez
