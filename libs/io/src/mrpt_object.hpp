#pragma once

#include <mrpt/io/CFileGZInputStream.h>
#include <mrpt/serialization/CArchive.h>

#include <exception>
#include <string>

#include "byte_stream.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::io {

/// Reads one MRPT object; InputError for anything but a sound file of that class.
template <class T>
void readMrptObject(const std::string& path, T& object, const std::string& what) {
  (void)openFile(path);  // tells missing and empty files apart from damaged ones
  std::string reason;
  try {
    mrpt::io::CFileGZInputStream stream(path);
    auto archive = mrpt::serialization::archiveFrom(stream);
    archive >> object;
    return;
  } catch (const std::exception& e) {
    // MRPT's texts are a banner, "Message:  what it is", and where in its code.
    reason = e.what();
    if (const auto message = reason.find("Message:"); message != std::string::npos) {
      reason.erase(0, reason.find_first_not_of(' ', message + 8));
    }
    reason = reason.substr(0, reason.find('\n'));
  }
  throw InputError(path + ": not a readable " + what + " (" + reason + "); export it again");
}

}  // namespace vestibule::io
