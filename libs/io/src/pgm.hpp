#pragma once

#include <opencv2/core.hpp>
#include <string>

namespace vestibule::io {

/// True for the greyscale kinds of Netpbm, ASCII (P2) and binary (P5), by their first bytes.
[[nodiscard]] bool looksLikePgm(const std::string& bytes);

/// Shades of a PGM: 8 bit where white is 255, else 16 bit with the file's white (its maxval) at
/// 65535. OpenCV's reader leaves values as they are, whatever the maxval, and asks for a line end
/// after the last one.
/// Throws InputError that begins with `where`. \pre looksLikePgm(bytes)
[[nodiscard]] cv::Mat decodePgm(const std::string& bytes, const std::string& where);

}  // namespace vestibule::io
