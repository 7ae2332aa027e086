#pragma once

#include <string>
#include <vector>

namespace omnifleet::ahmed {

/// Fig. 1: an image of a forward camera, its floor, and the distance vector, from the frame whose boundary
/// varies most.
/// @param overlays those of the literal method; empty: default options
void drawDistanceVector(const std::string& recording, const std::vector<std::string>& overlays,
                        const std::string& path);

/// Figs. 5 and 6: the last images of both ceiling cameras, and the maps of the runs, each with the true faces
/// in red.
/// @param runs caption and folder
void drawMaps(const std::string& recording, const std::vector<std::pair<std::string, std::string>>& runs,
              const std::string& path);

/// Pictures side by side, each with its caption.
void drawBeside(const std::vector<std::pair<std::string, std::string>>& pictures, const std::string& path);

}  // namespace omnifleet::ahmed
