// The one DDS type of this backend: bytes. Writers hand an Encoder to the vendor, readers get a view of the payload.
#pragma once

#include <fastdds/dds/topic/TopicDataType.hpp>

#include "idl/type_info.hpp"

namespace adit::fastdds {

// Plain CDR of either endianness; what else a foreign writer may send (parameter lists, XCDR2) nobody here can decode.
inline bool is_plain_cdr(Bytes sample) {
  return sample.size() >= 4 && sample[0] == std::byte{0} && sample[1] <= std::byte{1};
}

// What deserialize() leaves in a loaned sample: where the payload is. Valid while the loan lasts.
struct PayloadView {
  const std::byte* data = nullptr;
  std::uint32_t size = 0;
};

// On the writing side `data` is a `const Encoder*`, on the reading side a `PayloadView*`; samples must be taken by
// loan, for a copying take gives the payload back before the view is read.
class SerializedType final : public eprosima::fastdds::dds::TopicDataType {
 public:
  explicit SerializedType(const TypeInfo& type);

  bool serialize(void* encoder, eprosima::fastrtps::rtps::SerializedPayload_t* payload) override;
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* view) override;
  std::function<std::uint32_t()> getSerializedSizeProvider(void* encoder) override;
  void* createData() override;
  void deleteData(void* view) override;
  bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
};

}  // namespace adit::fastdds
