#include <filesystem>

#include "components/dataset/png8.hpp"
#include "components/runtime/component.hpp"
#include "components/runtime/stamp.hpp"
#include "sensor_msgs/msg/image.hpp"

namespace adit {
namespace {

class PictureWriterComponent final : public Component {
  using Image = sensor_msgs::msg::Image;

  Param<std::string> path_{*this, "path", std::string("picture.png"), "the PNG file to write"};
  Param<double> after_{*this,        "after",         5.0,
                       Unit::second, Range{0.0, 1e6}, "the first image this long after the first one"};
  Input<Image> image_{*this, "image", Qos::reliable(2), Queue{2, WhenFull::drop_oldest},
                      [this](const Image& image, const MessageInfo&) { on_image(image); }};
  std::optional<Time> first_;
  bool done_ = false;

  Result<void> activate() override {
    first_.reset();
    done_ = false;
    return {};
  }

  void on_image(const Image& image) {
    const Time stamp = to_time(image.header.stamp);
    if (!first_) first_ = stamp;
    if (done_ || std::chrono::duration<double>(stamp - *first_).count() < after_) return;
    done_ = true;
    if (Result<void> written = write(image); !written) health(Health::warn, written.error().message);
  }

  Result<void> write(const Image& image) const {
    const bool rgb = image.encoding == "rgb8";
    if (!rgb && image.encoding != "mono8") {
      return Error{ErrorCode::malformed, "image: " + image.encoding + ", not rgb8 or mono8"};
    }
    std::error_code ignored;
    const std::filesystem::path path(path_.value());
    if (path.has_parent_path()) std::filesystem::create_directories(path.parent_path(), ignored);
    return dataset::write_png8(path.string(),
                               {image.width, image.height, rgb ? 3U : 1U, image.step, image.data.span()});
  }
};

ADIT_COMPONENT(PictureWriterComponent, "picture_writer");

}  // namespace
}  // namespace adit
