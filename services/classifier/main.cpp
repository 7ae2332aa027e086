#include "bus/service_runner.h"
#include "classifier/service.h"

int main(int argc, char** argv) {
  return omnifleet::bus::runService(argc, argv, "classifier", omnifleet::services::makeClassifier);
}
