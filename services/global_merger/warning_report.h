#pragma once

#include "bus/status_board.h"
#include "global_merger/merger.h"

namespace omnifleet::services {

/// Reports what is uncertain or missing in a finished map. The status shows only the last message, so the
/// summary comes last.
void reportMapWarnings(const global_merger::Merger& map, bus::StatusBoard& status);

}  // namespace omnifleet::services
