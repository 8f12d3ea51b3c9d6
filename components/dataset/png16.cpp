#include "components/dataset/png16.hpp"

#include <png.h>

#include <bit>
#include <cerrno>
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <memory>

namespace adit::dataset {
namespace {

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

void keep_message(png_structp png, png_const_charp message) {
  *static_cast<std::string*>(png_get_error_ptr(png)) = message;
  std::longjmp(png_jmpbuf(png), 1);
}

void ignore_warning(png_structp, png_const_charp) {}

// The two functions below hold nothing but plain data between setjmp and longjmp; buffers belong to the caller.
bool read_header(png_structp png, png_infop info, std::FILE* file) {
  if (setjmp(png_jmpbuf(png))) return false;
  png_init_io(png, file);
  png_read_info(png, info);
  if (png_get_color_type(png, info) != PNG_COLOR_TYPE_GRAY || png_get_bit_depth(png, info) != 16) return true;
  if (std::endian::native == std::endian::little) png_set_swap(png);
  png_read_update_info(png, info);
  return true;
}

bool read_rows(png_structp png, png_bytepp rows) {
  if (setjmp(png_jmpbuf(png))) return false;
  png_read_image(png, rows);
  return true;
}

bool write_all(png_structp png, png_infop info, std::FILE* file, std::uint32_t width, std::uint32_t height,
               png_bytepp rows) {
  if (setjmp(png_jmpbuf(png))) return false;
  png_init_io(png, file);
  png_set_IHDR(png, info, width, height, 16, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  png_set_compression_level(png, 3);
  png_write_info(png, info);
  if (std::endian::native == std::endian::little) png_set_swap(png);
  png_write_image(png, rows);
  png_write_end(png, nullptr);
  return true;
}

std::vector<png_bytep> row_pointers(Image16& image) {
  std::vector<png_bytep> rows(image.height);
  for (std::uint32_t y = 0; y < image.height; ++y) {
    rows[y] = reinterpret_cast<png_bytep>(image.pixels.data() + static_cast<std::size_t>(y) * image.width);
  }
  return rows;
}

}  // namespace

Result<Image16> read_png16(const std::string& path) {
  const File file(std::fopen(path.c_str(), "rb"));
  if (!file) return Error{ErrorCode::not_found, path + ": cannot read: " + std::strerror(errno)};
  std::string reason;
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &reason, keep_message, ignore_warning);
  png_infop info = png_create_info_struct(png);
  Image16 image;
  std::vector<png_bytep> rows;
  bool done = read_header(png, info, file.get());
  if (done && (png_get_color_type(png, info) != PNG_COLOR_TYPE_GRAY || png_get_bit_depth(png, info) != 16)) {
    reason = "not a 16-bit grey image (" + std::to_string(png_get_channels(png, info)) + " channels of " +
             std::to_string(png_get_bit_depth(png, info)) + " bits): thermal data must not have been reduced to 8 bits";
    done = false;
  }
  if (done) {
    image.width = png_get_image_width(png, info);
    image.height = png_get_image_height(png, info);
    image.pixels.resize(static_cast<std::size_t>(image.width) * image.height);
    rows = row_pointers(image);
    done = read_rows(png, rows.data());
  }
  png_destroy_read_struct(&png, &info, nullptr);
  if (!done) return Error{ErrorCode::malformed, path + ": " + reason};
  return image;
}

Result<void> write_png16(const std::string& path, const Image16& image) {
  if (image.pixels.size() != static_cast<std::size_t>(image.width) * image.height || image.pixels.empty()) {
    return Error{ErrorCode::invalid_argument, path + ": the image has no pixels, or not width x height of them"};
  }
  const File file(std::fopen(path.c_str(), "wb"));
  if (!file) return Error{ErrorCode::io, path + ": cannot write: " + std::strerror(errno)};
  std::string reason;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &reason, keep_message, ignore_warning);
  png_infop info = png_create_info_struct(png);
  // libpng does not write through the row pointers, its interface just is not const.
  std::vector<png_bytep> rows = row_pointers(const_cast<Image16&>(image));
  const bool done = write_all(png, info, file.get(), image.width, image.height, rows.data());
  png_destroy_write_struct(&png, &info);
  if (!done || std::fflush(file.get()) != 0) {
    return Error{ErrorCode::io, path + ": " + (reason.empty() ? std::strerror(errno) : reason)};
  }
  return {};
}

}  // namespace adit::dataset
