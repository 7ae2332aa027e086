#include "bus/service_runner.h"
#include "local_mapper/service.h"

int main(int argc, char** argv) {
  return omnifleet::bus::runService(argc, argv, "local_mapper", omnifleet::services::makeLocalMapper);
}
