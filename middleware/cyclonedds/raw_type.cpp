#include "middleware/cyclonedds/raw_type.hpp"

#include <dds/dds.h>
#include <dds/ddsi/q_protocol.h>
#include <dds/ddsi/q_radmin.h>
#include <dds/version.h>

#include <atomic>
#include <cstdio>
#include <cstring>
#include <limits>
#include <new>

#include "middleware/cyclonedds/sample_pool.hpp"

static_assert(DDS_VERSION_MAJOR == 0 && DDS_VERSION_MINOR == 10, "written for the internal interfaces of 0.10");

namespace adit::cyclonedds {
namespace {

RawSample* raw(ddsi_serdata* data) {
  return static_cast<RawSample*>(data);
}
const RawSample* raw(const ddsi_serdata* data) {
  return static_cast<const RawSample*>(data);
}

// Cyclone does not hand the sequence number to a serdata; it is in the (DATA or DATA_FRAG) submessage that the first
// fragment came in, where Cyclone has already brought it to host byte order.
std::uint64_t sequence_of(const nn_rdata* fragment) {
  const unsigned offset = NN_RDATA_SUBMSG_OFF(fragment);
  if (offset == 0) return 0;
  Data_DataFrag_common_t submessage;
  std::memcpy(&submessage, NN_RMSG_PAYLOADOFF(fragment->rmsg, offset), sizeof submessage);
  if (submessage.smhdr.submessageId != SMID_DATA && submessage.smhdr.submessageId != SMID_DATA_FRAG) return 0;
  return (static_cast<std::uint64_t>(static_cast<std::uint32_t>(submessage.writerSN.high)) << 32) |
         submessage.writerSN.low;
}

bool same_key(const ddsi_serdata*, const ddsi_serdata*) {
  return true;  // no type of ours has a key: one instance a topic
}

std::uint32_t get_size(const ddsi_serdata* data) {
  return raw(data)->size;
}

ddsi_serdata* from_fragments(const ddsi_sertype* type, ddsi_serdata_kind kind, const nn_rdata* fragment,
                             std::size_t size) {
  RawSample* const sample = RawSample::create(type, kind, size);
  if (!sample) return nullptr;
  sample->sequence = sequence_of(fragment);
  std::size_t end = 0;
  for (; fragment; fragment = fragment->nextfrag) {  // fragments may overlap
    const std::size_t fragment_end = std::min<std::size_t>(fragment->maxp1, size);
    if (fragment_end <= end || fragment->min > end) continue;
    const unsigned char* const from = NN_RMSG_PAYLOADOFF(fragment->rmsg, NN_RDATA_PAYLOAD_OFF(fragment));
    std::memcpy(sample->payload + end, from + (end - fragment->min), fragment_end - end);
    end = fragment_end;
  }
  std::memset(sample->payload + end, 0, sample->size - end);
  return sample;
}

ddsi_serdata* from_vectors(const ddsi_sertype* type, ddsi_serdata_kind kind, ddsrt_msg_iovlen_t count,
                           const ddsrt_iovec_t* vectors, std::size_t size) {
  RawSample* const sample = RawSample::create(type, kind, size);
  if (!sample) return nullptr;
  std::size_t end = 0;
  for (ddsrt_msg_iovlen_t i = 0; i < count && end < size; ++i) {
    const std::size_t length = std::min<std::size_t>(vectors[i].iov_len, size - end);
    std::memcpy(sample->payload + end, vectors[i].iov_base, length);
    end += length;
  }
  std::memset(sample->payload + end, 0, sample->size - end);
  return sample;
}

ddsi_serdata* from_key_hash(const ddsi_sertype* type, const ddsi_keyhash*) {
  return RawSample::create(type, SDK_KEY, 0);
}

ddsi_serdata* from_object(const ddsi_sertype* type, ddsi_serdata_kind kind, const void*) {
  return kind == SDK_KEY ? RawSample::create(type, kind, 0) : nullptr;  // we only write serialized samples
}

void to_bytes(const ddsi_serdata* data, std::size_t offset, std::size_t size, void* out) {
  std::memcpy(out, raw(data)->payload + offset, size);
}

ddsi_serdata* lend_bytes(const ddsi_serdata* data, std::size_t offset, std::size_t size, ddsrt_iovec_t* out) {
  out->iov_base = raw(data)->payload + offset;
  out->iov_len = static_cast<ddsrt_iov_len_t>(size);
  return ddsi_serdata_ref(data);
}

void return_bytes(ddsi_serdata* data, const ddsrt_iovec_t*) {
  ddsi_serdata_unref(data);
}

bool to_object(const ddsi_serdata*, void*, void**, void*) {
  return false;  // samples are only taken serialized
}

ddsi_serdata* to_untyped(const ddsi_serdata* data) {
  RawSample* const sample = RawSample::create(data->type, SDK_KEY, 0);
  if (sample) sample->type = nullptr;
  return sample;
}

bool untyped_to_object(const ddsi_sertype*, const ddsi_serdata*, void*, void**, void*) {
  return false;
}

void free_sample(ddsi_serdata* data) {
  RawSample* const sample = raw(data);
  // What others did with the sample before they let go is done (see release below).
  static_cast<void>(std::atomic_ref(sample->refc.v).load(std::memory_order_acquire));
  const std::size_t capacity = sample->capacity;
  sample->~RawSample();
  return_block(sample, capacity);
}

std::size_t print(const ddsi_sertype*, const ddsi_serdata* data, char* text, std::size_t size) {
  return static_cast<std::size_t>(std::snprintf(text, size, "%u bytes", raw(data)->size));
}

void get_key_hash(const ddsi_serdata*, ddsi_keyhash* hash, bool) {
  std::memset(hash, 0, sizeof *hash);
}

std::uint32_t get_shared_size(const ddsi_serdata* data) {
  return raw(data)->size;
}

ddsi_serdata* from_shared_memory(const ddsi_sertype*, ddsi_serdata_kind, void*, void*) {
  return nullptr;
}

const ddsi_serdata_ops sample_operations = {
    .eqkey = same_key,
    .get_size = get_size,
    .from_ser = from_fragments,
    .from_ser_iov = from_vectors,
    .from_keyhash = from_key_hash,
    .from_sample = from_object,
    .to_ser = to_bytes,
    .to_ser_ref = lend_bytes,
    .to_ser_unref = return_bytes,
    .to_sample = to_object,
    .to_untyped = to_untyped,
    .untyped_to_sample = untyped_to_object,
    .free = free_sample,
    .print = print,
    .get_keyhash = get_key_hash,
    .get_sample_size = get_shared_size,
    .from_iox_buffer = from_shared_memory,
};

void free_type(ddsi_sertype* type) {
  ddsi_sertype_fini(type);
  delete type;
}

bool same_type(const ddsi_sertype*, const ddsi_sertype*) {
  return true;  // asked only for types of the same name
}

std::uint32_t hash_type(const ddsi_sertype*) {
  return 0;
}

void no_objects(const ddsi_sertype*, void*, std::size_t) {}

void no_object_memory(void** objects, const ddsi_sertype*, void*, std::size_t, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) objects[i] = nullptr;
}

void no_objects_to_free(const ddsi_sertype*, void**, std::size_t, dds_free_op_t) {}

// No type information, no type object: ROS 2 endpoints of this version announce none either.
const ddsi_sertype_ops type_operations = {
    .version = ddsi_sertype_v0,
    .arg = nullptr,
    .free = free_type,
    .zero_samples = no_objects,
    .realloc_samples = no_object_memory,
    .free_samples = no_objects_to_free,
    .equal = same_type,
    .hash = hash_type,
    .type_id = nullptr,
    .type_map = nullptr,
    .type_info = nullptr,
    .derive_sertype = nullptr,
    .get_serialized_size = nullptr,
    .serialize_into = nullptr,
};

}  // namespace

RawSample* RawSample::create(const ddsi_sertype* type, ddsi_serdata_kind kind, std::size_t payload_size) noexcept {
  constexpr std::size_t payload_offset = (sizeof(RawSample) + 4 + 15) / 16 * 16 - 4;
  if (payload_size > std::numeric_limits<std::uint32_t>::max() - 3) return nullptr;
  const std::size_t padded = (payload_size + 3) & ~std::size_t{3};
  std::size_t capacity = 0;
  void* const block = take_block(payload_offset + padded, capacity);
  if (!block) return nullptr;
  auto* const sample = new (block) RawSample;
  ddsi_serdata_init(sample, type, kind);
  sample->sequence = 0;
  sample->capacity = capacity;
  sample->size = static_cast<std::uint32_t>(padded);
  sample->payload = static_cast<std::byte*>(block) + payload_offset;
  return sample;
}

ddsi_sertype* make_raw_type(const char* dds_type_name) {
  auto* const type = new ddsi_sertype{};
  ddsi_sertype_init_flags(type, dds_type_name, &type_operations, &sample_operations,
                          DDSI_SERTYPE_FLAG_TOPICKIND_NO_KEY);
  type->allowed_data_representation = DDS_DATA_REPRESENTATION_FLAG_XCDR1;
  return type;
}

// Cyclone's ddsi_serdata_ref and ddsi_serdata_unref, with atomic operations that ThreadSanitizer sees.
const KeepAliveOperations raw_sample_reference = {
    [](void* handle) noexcept {
      std::atomic_ref(static_cast<RawSample*>(handle)->refc.v).fetch_add(1, std::memory_order_relaxed);
    },
    [](void* handle) noexcept {
      auto* const sample = static_cast<RawSample*>(handle);
      if (std::atomic_ref(sample->refc.v).fetch_sub(1, std::memory_order_acq_rel) == 1) free_sample(sample);
    },
};

}  // namespace adit::cyclonedds
