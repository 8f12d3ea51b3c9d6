#include "components/runtime/component.hpp"
#include "std_msgs/msg/string.hpp"

namespace adit::examples {

// Logs what it hears.
class Listener final : public Component {
  Input<std_msgs::msg::String> chatter_{
      *this, "chatter", Qos::reliable(10), Queue{10, WhenFull::drop_oldest},
      [this](const std_msgs::msg::String& message, const MessageInfo&) { log().info("I heard: {}", message.data); }};
};

ADIT_COMPONENT(Listener, "listener");

}  // namespace adit::examples
