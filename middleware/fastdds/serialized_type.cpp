#include "middleware/fastdds/serialized_type.hpp"

#include <algorithm>

namespace adit::fastdds {

SerializedType::SerializedType(const TypeInfo& type) {
  // Only where payload buffers start: they grow to what a message needs and keep that size.
  constexpr std::size_t smallest = 64, largest = 64 << 10;
  setName(std::string(type.dds_name).c_str());
  m_typeSize = static_cast<std::uint32_t>(std::clamp(type.typical_size, smallest, largest));
  m_isGetKeyDefined = false;
  auto_fill_type_object(false);
  auto_fill_type_information(false);
}

bool SerializedType::serialize(void* encoder, eprosima::fastrtps::rtps::SerializedPayload_t* payload) {
  const auto& message = *static_cast<const Encoder*>(encoder);
  const std::size_t written = message.write({reinterpret_cast<std::byte*>(payload->data), payload->max_size});
  if (written < 4) return false;
  payload->length = static_cast<std::uint32_t>(written);
  payload->encapsulation = payload->data[1] & 1 ? CDR_LE : CDR_BE;
  return true;
}

bool SerializedType::deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* view) {
  *static_cast<PayloadView*>(view) = {reinterpret_cast<const std::byte*>(payload->data), payload->length};
  return true;
}

std::function<std::uint32_t()> SerializedType::getSerializedSizeProvider(void* encoder) {
  return [encoder] { return static_cast<std::uint32_t>(static_cast<const Encoder*>(encoder)->size()); };
}

void* SerializedType::createData() {
  return new PayloadView;
}

void SerializedType::deleteData(void* view) {
  delete static_cast<PayloadView*>(view);
}

}  // namespace adit::fastdds
