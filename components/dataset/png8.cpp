#include "components/dataset/png8.hpp"

#include <png.h>

namespace adit::dataset {

Result<void> write_png8(const std::string& path, const Picture8& picture) {
  const std::uint64_t row = std::uint64_t{picture.width} * picture.channels;
  const std::uint64_t step = picture.step > 0 ? picture.step : row;
  const bool fine = (picture.channels == 1 || picture.channels == 3) && row > 0 && picture.height > 0 && step >= row &&
                    step <= INT32_MAX && picture.data.size() >= (picture.height - 1) * step + row;
  if (!fine) {
    return Error{ErrorCode::invalid_argument, path + ": not a picture of 1 or 3 channels with all its pixels"};
  }
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = picture.width;
  png.height = picture.height;
  png.format = picture.channels == 3 ? PNG_FORMAT_RGB : PNG_FORMAT_GRAY;
  if (png_image_write_to_file(&png, path.c_str(), 0, picture.data.data(), static_cast<png_int_32>(step), nullptr) ==
      0) {
    return Error{ErrorCode::io, path + ": " + png.message};
  }
  return {};
}

}  // namespace adit::dataset
