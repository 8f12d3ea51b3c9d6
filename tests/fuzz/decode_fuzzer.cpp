// libFuzzer target: the decoders of one package (ADIT_FUZZ_PACKAGE). The first byte of the input chooses the type.
#include <sanitizer/allocator_interface.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include "tests/fuzz/decode_property.hpp"

namespace {

thread_local std::size_t allocated = 0;

void fail(const adit::MessageType& type, const char* what) {
  std::fprintf(stderr, "%.*s: %s\n", static_cast<int>(type.info->ros_name.size()), type.info->ros_name.data(), what);
  std::abort();
}

std::vector<const adit::MessageType*> types_of_package() {
  std::vector<const adit::MessageType*> types;
  for (const adit::MessageType& type : adit::all_types()) {
    if (type.info->ros_name.starts_with(ADIT_FUZZ_PACKAGE "/")) types.push_back(&type);
  }
  return types;
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  __sanitizer_install_malloc_and_free_hooks([](const volatile void*, std::size_t size) { allocated += size; },
                                            [](const volatile void*) {});
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const auto types = types_of_package();
  if (size == 0) return 0;
  const adit::MessageType& type = *types[data[0] % types.size()];
  const adit::Bytes payload = std::as_bytes(std::span(data + 1, size - 1));
  allocated = 0;
  std::vector<std::byte> again;
  (void)type.reencode(payload, again);
  if (allocated > adit::test::allocation_limit(payload.size())) fail(type, "allocates more than the payload can hold");
  const std::string reason = adit::test::check_decode(type, payload);
  if (!reason.empty()) fail(type, reason.c_str());
  return 0;
}
