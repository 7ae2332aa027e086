#include "bus/service_runner.h"
#include "formation/service.h"

int main(int argc, char** argv) {
  return omnifleet::bus::runService(argc, argv, "formation", omnifleet::services::makeFormation);
}
