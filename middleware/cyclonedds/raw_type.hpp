// Cyclone's idea of a type and of a sample, for payloads that we never look into: serialized bytes in, the same bytes
// out. Fills the interfaces of ddsi_sertype.h and ddsi_serdata.h.
#pragma once

#include <dds/ddsi/ddsi_serdata.h>
#include <dds/ddsi/ddsi_sertype.h>

#include "middleware/sample.hpp"

namespace adit::cyclonedds {

// One serialized sample, counted by Cyclone's reference count; the bytes follow the object in the same pooled block.
// Immutable once it is handed to Cyclone.
struct RawSample : ddsi_serdata {
  std::uint64_t sequence;  // the writer's counter; 0: unknown
  std::size_t capacity;    // of the pooled block
  std::uint32_t size;      // of the payload: encapsulation header, data, padding; a multiple of 4
  std::byte* payload;      // (payload + 4), where the data starts, is aligned to 16

  // With one reference, payload uninitialized. Null: out of memory.
  static RawSample* create(const ddsi_sertype* type, ddsi_serdata_kind kind, std::size_t payload_size) noexcept;

  Bytes bytes() const { return {payload, size}; }
  // Encapsulation is CDR_BE or CDR_LE, the only ones of XCDR1 that our readers ask for.
  bool is_plain_cdr() const {
    return size >= 4 && payload[0] == std::byte{0} && (payload[1] | std::byte{1}) == std::byte{1};
  }
};

// A sertype for `dds_type_name`, with one reference that dds_create_topic_sertype takes over.
ddsi_sertype* make_raw_type(const char* dds_type_name);

// How a Sample holds a RawSample.
extern const KeepAliveOperations raw_sample_reference;

}  // namespace adit::cyclonedds
