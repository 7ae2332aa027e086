#include "bus/service_runner.h"
#include "localizer/service.h"

int main(int argc, char** argv) {
  return omnifleet::bus::runService(argc, argv, "localizer", omnifleet::services::makeLocalizer);
}
