#include "global_merger/map_saver.h"

#include <exception>
#include <filesystem>
#include <iterator>

#include "common/messages.h"
#include "global_merger/merge_report.h"
#include "global_merger/messages.h"

namespace omnifleet::services {

MapSaver::MapSaver(std::string out, const fleet::Fleet& fleet) : out_(std::move(out)) {
  for (const fleet::RobotSpec& robot : fleet.robots) robots_.push_back(robot.name);
}

void MapSaver::save(const global_merger::Merger& common, const global_merger::OwnMaps& own,
                    const std::map<std::string, Alignment>& alignments,
                    const global_merger::PlaceFiles& places, bus::StatusBoard& status) {
  if (out_.empty()) return;
  std::vector<std::string> problems = common.saveAsFitted(out_);
  std::vector<std::string> of_places = places.save(out_);  // before the folders of own maps are removed
  std::move(of_places.begin(), of_places.end(), std::back_inserter(problems));
  std::vector<std::string> of_own = own.save(common, out_ + "/maps");
  std::move(of_own.begin(), of_own.end(), std::back_inserter(problems));
  try {
    dataset::writeMerge(out_ + "/merge.json", global_merger::mergeReport(robots_, alignments, common));
  } catch (const std::exception& problem) {
    problems.emplace_back(problem.what());
  }
  failed_ = !problems.empty();
  if (!failed_) return;
  std::string files;
  for (const std::string& problem : problems) {
    status.report(fileWriteFailed(problem), true);
    const std::string path = problem.substr(0, problem.find(": "));
    files += (files.empty() ? "" : ", ") + std::filesystem::path(path).filename().string();
  }
  status.report(global_merger::mapNotSaved(files, problems.front().substr(problems.front().rfind(": ") + 2)),
                true);
}

}  // namespace omnifleet::services
