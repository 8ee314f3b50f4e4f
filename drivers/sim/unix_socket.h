#pragma once

#include <cstddef>
#include <filesystem>
#include <span>

#include "calib/files/file_descriptor.h"

namespace vantage::sim {

/// A SOCK_SEQPACKET socket that listens at `path`. A stale file, which nobody listens at any more, is replaced.
/// \throws InputError when the path is too long, is taken by a live program or something that is no socket, or can't be
/// created.
FileDescriptor listen_at(const std::filesystem::path& path);

/// A connection to `path`; invalid, with errno set, when nobody listens there.
/// \throws InputError when the path is too long for a socket.
FileDescriptor connect_to(const std::filesystem::path& path);

/// Sends one datagram, with a descriptor beside it unless `attached` is negative. Never blocks, never raises SIGPIPE.
/// False, with errno set, when the peer is gone (EPIPE, ECONNRESET) or does not read (EAGAIN).
bool send_datagram(int socket, std::span<const std::byte> datagram, int attached = -1);

template <typename Message>
bool send_message(int socket, const Message& message, int attached = -1) {
  return send_datagram(socket, std::as_bytes(std::span(&message, 1)), attached);
}

enum class ReceiveStatus { kDatagram, kNothingYet, kClosed };

/// Takes one datagram without waiting; `size` receives its length, at most the buffer's. A descriptor that came beside
/// it goes to `attached`, or is closed when that is null.
ReceiveStatus receive_datagram(int socket, std::span<std::byte> buffer, std::size_t* size,
                               FileDescriptor* attached = nullptr);

}  // namespace vantage::sim
