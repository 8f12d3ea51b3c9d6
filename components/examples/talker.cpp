#include "components/runtime/component.hpp"
#include "std_msgs/msg/string.hpp"

namespace adit::examples {

// Says something twice a second.
class Talker final : public Component {
  Param<std::string> text_{*this, "text", "Hello World", "what to say"};
  Param<double> rate_{*this, "rate", 2.0, Unit::hertz, Range{0.001, 10'000.0}};
  Output<std_msgs::msg::String> chatter_{*this, "chatter", Qos::reliable(10)};
  Timer timer_{*this, "talk", std::chrono::milliseconds(500), [this] { talk(); }};
  int count_ = 0;

  Result<void> configure() override {
    timer_.set_period(Duration(static_cast<Duration::rep>(1e9 / rate_)));
    return {};
  }

  void talk() {
    Loan<std_msgs::msg::String> message = chatter_.loan();
    message->data = fmt::format("{}: {}", text_.value(), ++count_);
    chatter_.publish(std::move(message));
  }
};

ADIT_COMPONENT(Talker, "talker");

}  // namespace adit::examples
