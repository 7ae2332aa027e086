#include "bus/fake_network.h"

#include <algorithm>

#include "bus/partition.h"

namespace omnifleet::bus {

std::shared_ptr<FakeNetwork> makeFakeNetwork() {
  return std::make_shared<FakeNetwork>();
}

void FakeNetwork::attach(FakeEndpoint& endpoint) {
  std::lock_guard<std::mutex> lock(mutex);
  endpoint.id = next_id_++;
  by_topic_[endpoint.topic].push_back(&endpoint);
  endpoint.signal->event.signal();
  forEachPeer(endpoint, [&](FakeEndpoint& peer) {
    endpoint.onPeer(peer);
    peer.onPeer(endpoint);
    peer.signal->event.signal();
  });
}

void FakeNetwork::detach(FakeEndpoint& endpoint) {
  std::lock_guard<std::mutex> lock(mutex);
  forEachPeer(endpoint, [&](FakeEndpoint& peer) { peer.signal->event.signal(); });
  auto& ends = by_topic_[endpoint.topic];
  ends.erase(std::remove(ends.begin(), ends.end(), &endpoint), ends.end());
}

int FakeNetwork::matched(const FakeEndpoint& endpoint) {
  std::lock_guard<std::mutex> lock(mutex);
  int count = 0;
  forEachPeer(endpoint, [&](FakeEndpoint&) { ++count; });
  return count;
}

bool FakeNetwork::match(const FakeEndpoint& a, const FakeEndpoint& b) {
  if (a.kind == b.kind || a.type_name != b.type_name) return false;
  return std::find_first_of(a.partitions.begin(), a.partitions.end(), b.partitions.begin(),
                            b.partitions.end()) != a.partitions.end();
}

}  // namespace omnifleet::bus
