// The least type a Fast DDS program can have: a vector of bytes, copied in and out as sequence<octet> or string.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include <fastdds/dds/topic/TopicDataType.hpp>

namespace adit::bench {

class BytesType final : public eprosima::fastdds::dds::TopicDataType {
 public:
  using Payload = eprosima::fastrtps::rtps::SerializedPayload_t;
  using Bytes = std::vector<std::uint8_t>;

  BytesType(const std::string& name, std::size_t most_bytes) {
    setName(name.c_str());
    m_typeSize = static_cast<std::uint32_t>(most_bytes + 8);
    m_isGetKeyDefined = false;
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }
  bool serialize(void* data, Payload* payload) override {
    const Bytes& bytes = *static_cast<const Bytes*>(data);
    const auto length = static_cast<std::uint32_t>(bytes.size());
    if (payload->max_size < length + 8) return false;
    const std::uint8_t little_endian[4] = {0, 1, 0, 0};
    std::memcpy(payload->data, little_endian, 4);
    std::memcpy(payload->data + 4, &length, 4);
    std::memcpy(payload->data + 8, bytes.data(), length);
    payload->length = length + 8;
    payload->encapsulation = CDR_LE;
    return true;
  }
  bool deserialize(Payload* payload, void* data) override {
    std::uint32_t length = 0;
    if (payload->length < 8) return false;
    std::memcpy(&length, payload->data + 4, 4);
    if (length > payload->length - 8) return false;
    static_cast<Bytes*>(data)->assign(payload->data + 8, payload->data + 8 + length);
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<std::uint32_t>(static_cast<const Bytes*>(data)->size() + 8); };
  }
  void* createData() override { return new Bytes; }
  void deleteData(void* data) override { delete static_cast<Bytes*>(data); }
  bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
};

}  // namespace adit::bench
