#include "bus/service_runner.h"
#include "global_merger/service.h"

int main(int argc, char** argv) {
  return omnifleet::bus::runService(argc, argv, "global_merger", omnifleet::services::makeGlobalMerger);
}
