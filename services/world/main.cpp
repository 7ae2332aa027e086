#include "bus/service_runner.h"
#include "world/service.h"

int main(int argc, char** argv) {
  return omnifleet::bus::runService(argc, argv, "world", omnifleet::services::makeWorld);
}
