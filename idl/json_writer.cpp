#include "idl/json_writer.hpp"

#include <charconv>
#include <cmath>
#include <cstdio>

namespace adit {
namespace {

void append_floating(std::string& out, double value, int digits) {
  if (std::isnan(value)) {
    out += "\"nan\"";
  } else if (std::isinf(value)) {
    out += value > 0 ? "\"inf\"" : "\"-inf\"";
  } else {
    char text[40];
    std::snprintf(text, sizeof text, "%.*g", digits, value);
    out += text;
    if (std::string_view(text).find_first_of(".e") == std::string_view::npos) out += ".0";
  }
}

// Bytes of the well-formed UTF-8 sequence that `text` starts with, 0 when it does not (Unicode 15, table 3-7).
std::size_t utf8_length(std::string_view text) {
  const auto at = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u; };
  const auto in = [&](std::size_t i, unsigned low, unsigned high) { return at(i) >= low && at(i) <= high; };
  const auto tail = [&](std::size_t i) { return in(i, 0x80, 0xbf); };
  const unsigned lead = at(0);
  if (lead < 0x80) return 1;
  if (lead >= 0xc2 && lead <= 0xdf) return tail(1) ? 2 : 0;
  if (lead >= 0xe0 && lead <= 0xef) {
    const bool second = in(1, lead == 0xe0 ? 0xa0 : 0x80, lead == 0xed ? 0x9f : 0xbf);
    return second && tail(2) ? 3 : 0;
  }
  if (lead >= 0xf0 && lead <= 0xf4) {
    const bool second = in(1, lead == 0xf0 ? 0x90 : 0x80, lead == 0xf4 ? 0x8f : 0xbf);
    return second && tail(2) && tail(3) ? 4 : 0;
  }
  return 0;
}

template <class Integer>
void append_integer(std::string& out, Integer value) {
  char text[24];
  out.append(text, std::to_chars(text, text + sizeof text, value).ptr);
}

}  // namespace

void JsonWriter::write(float value) {
  append_floating(out_, value, 9);
}

void JsonWriter::write(double value) {
  append_floating(out_, value, 17);
}

void JsonWriter::write_signed(std::int64_t value) {
  append_integer(out_, value);
}

void JsonWriter::write_unsigned(std::uint64_t value) {
  append_integer(out_, value);
}

void JsonWriter::write_omitted(std::size_t count) {
  out_ += "\"... ";
  append_integer(out_, count);
  out_ += " more\"";
}

void JsonWriter::write(std::string_view text) {
  out_ += '"';
  while (!text.empty()) {
    const char c = text.front();
    const std::size_t length = utf8_length(text);
    if (length == 0) {
      out_ += "\\ufffd";
    } else if (c == '"' || c == '\\') {
      out_ += '\\';
      out_ += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      char escape[8];
      std::snprintf(escape, sizeof escape, "\\u%04x", static_cast<unsigned>(c));
      out_ += escape;
    } else {
      out_ += text.substr(0, length);
    }
    text.remove_prefix(length == 0 ? 1 : length);
  }
  out_ += '"';
}

}  // namespace adit
