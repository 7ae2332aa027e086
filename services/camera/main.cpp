#include "bus/service_runner.h"
#include "camera/service.h"

int main(int argc, char** argv) {
  return omnifleet::bus::runService(argc, argv, "camera", omnifleet::services::makeCamera);
}
