#pragma once

#include "appearance/compass.h"
#include "geometry/pose2.h"

namespace omnifleet::estimation {

/// Logarithm of the likelihood of the compass' answer at a heading, relative to an answer that is even over
/// the circle, in nats: > 0 speaks for the heading, < 0 against it. The answer is normal about the true turn
/// with the probability `confidence`, else even. So an answer of low confidence says nothing, and none speaks
/// against a heading by more than ln(1 − most_confidence).
/// @param turn_rad of the other source, with its σ @param most_confidence of an answer, at most
double compassEvidence(const appearance::CompassResult& answer, double turn_rad, double sigma_rad,
                       double most_confidence);

/// What the compass needs to know of a displacement: its length, and its direction in the frame halfway
/// between both headings.
appearance::TravelHint hintOf(const Pose2& from_to);

}  // namespace omnifleet::estimation
