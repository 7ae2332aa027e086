#include "common/check_options.h"

#include "classifier/classifier.h"
#include "dataset/observation_rows.h"
#include "formation/formation.h"
#include "global_merger/merger.h"
#include "local_mapper/local_mapper.h"
#include "localizer/estimator_stage.h"
#include "localizer/observation_frames.h"
#include "markers/patch_finder.h"
#include "motion/wheel_integrator.h"
#include "world/world.h"

namespace omnifleet::services {

void checkOptions(const fleet::Fleet& fleet) {
  const options::Section mapper = fleet.service("local_mapper");
  motion::WheelIntegrator::Options::read(mapper.child("wheels"));
  local_mapper::Options::read(mapper);

  classifier::Classifier::Options::read(fleet.service("classifier"));

  const options::Section localizer = fleet.service("localizer");
  estimation::EstimatorOptions::read(localizer.child("estimator"));
  markers::FinderOptions::read(localizer.child("markers"));
  localizer::ObservationOptions::read(localizer.child("observations"));
  localizer.finish();

  const options::Section merger = fleet.service("global_merger");
  global_merger::KeyframeOptions::read(merger.child("keyframes"));
  global_merger::MergerOptions::read(merger.child("outlines"));
  occupancy::OccupancyOptions::read(merger.child("occupancy"));
  merger.finish();

  if (fleet.hasFormation()) formation::Formation::Options::read(fleet.service("formation"));
  const options::Section world = fleet.service("world");
  if (fleet.arena) {
    world::World::Options::read(world);
  } else {
    dataset::ObservationNoise::read(world.child("observations"));
    world.finish();
  }
  fleet.service("camera").finish();
}

}  // namespace omnifleet::services
