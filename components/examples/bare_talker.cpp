// Publishes std_msgs/String on /chatter: adit_bare_talker [seconds] [domain] [hertz].
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>

#include "idl/codec.hpp"
#include "middleware/participant.hpp"
#include "std_msgs/msg/string.hpp"

namespace {

volatile std::sig_atomic_t stop = 0;

}  // namespace

int main(int argc, char** argv) {
  using namespace adit;
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { stop = 1; });
  const double seconds = argc > 1 ? std::atof(argv[1]) : 10.0;
  const double hertz = argc > 3 ? std::atof(argv[3]) : 10.0;
  ParticipantConfig config;
  config.name = "bare_talker";
  if (argc > 2) config.domain = static_cast<std::uint32_t>(std::atoi(argv[2]));
  auto participant = open(config);
  if (!participant) {
    std::fprintf(stderr, "%s\n", participant.error().message.c_str());
    return 1;
  }
  EndpointConfig endpoint;
  endpoint.topic = "/chatter";
  endpoint.type = &type_info<std_msgs::msg::String>();
  endpoint.qos = Qos::reliable(10);
  endpoint.node = "/bare_talker";
  auto writer = (*participant)->writer(endpoint);
  if (!writer) {
    std::fprintf(stderr, "%s\n", writer.error().message.c_str());
    return 1;
  }
  std_msgs::msg::String message;
  for (int i = 0; i < static_cast<int>(hertz * seconds) && !stop; ++i) {
    message.data = "Hello World: " + std::to_string(i);
    if (auto sent = (*writer)->publish(MessageEncoder(message)); !sent) {
      std::fprintf(stderr, "%s\n", sent.error().message.c_str());
    }
    std::this_thread::sleep_for(std::chrono::duration<double>(1.0 / hertz));
  }
  return 0;
}
