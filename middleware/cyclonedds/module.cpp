// The entry point that open() finds.
#include <dds/version.h>

#include "middleware/cyclonedds/participant.hpp"
#include "middleware/vendor.hpp"

extern "C" __attribute__((visibility("default"))) const adit::VendorModule* ADIT_VENDOR_ENTRY_POINT() {
  static const adit::VendorModule module{"cyclonedds", DDS_VERSION, &adit::cyclonedds::open_participant};
  return &module;
}
