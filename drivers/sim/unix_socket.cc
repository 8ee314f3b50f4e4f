#include "drivers/sim/unix_socket.h"

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "calib/files/input_error.h"

namespace vantage::sim {
namespace {

sockaddr_un address_of(const std::filesystem::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string& name = path.native();
  if (name.empty() || name.size() >= sizeof address.sun_path) {
    throw InputError(name + ": a socket's path has 1 to " + std::to_string(sizeof address.sun_path - 1) +
                     " characters, this one " + std::to_string(name.size()) +
                     "; choose another, e.g. /tmp/vantage-sim");
  }
  std::memcpy(address.sun_path, name.c_str(), name.size() + 1);
  return address;
}

FileDescriptor new_socket() { return FileDescriptor(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0)); }

bool bind_to(int socket, const sockaddr_un& address) {
  return ::bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
}

/// Removes a socket file that nobody listens at.
void remove_if_stale(const std::filesystem::path& path) {
  struct stat status {};
  if (::lstat(path.c_str(), &status) != 0) return;
  if (!S_ISSOCK(status.st_mode)) throw InputError(path.string() + ": exists and is no socket; choose another path");
  // A full queue of a live program answers EAGAIN.
  FileDescriptor probe = connect_to(path);
  if (probe.valid() || errno == EAGAIN) {
    throw InputError(path.string() + ": another simulator serves here already; end it or choose another path");
  }
  if (errno == ECONNREFUSED) ::unlink(path.c_str());
}

/// Room for one descriptor beside a datagram.
union Control {
  cmsghdr header;
  char bytes[CMSG_SPACE(sizeof(int))];
};

}  // namespace

FileDescriptor listen_at(const std::filesystem::path& path) {
  const sockaddr_un address = address_of(path);
  remove_if_stale(path);
  FileDescriptor socket = new_socket();
  if (!socket.valid() || !bind_to(socket.get(), address) || ::listen(socket.get(), 4) != 0) {
    throw InputError(path.string() + ": the socket can't be created: " + std::strerror(errno));
  }
  return socket;
}

FileDescriptor connect_to(const std::filesystem::path& path) {
  const sockaddr_un address = address_of(path);
  FileDescriptor socket = new_socket();
  if (::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    const int error = errno;
    socket.reset();
    errno = error;
  }
  return socket;
}

bool send_datagram(int socket, std::span<const std::byte> datagram, int attached) {
  iovec part{const_cast<std::byte*>(datagram.data()), datagram.size()};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  Control control{};
  if (attached >= 0) {
    message.msg_control = &control;
    message.msg_controllen = sizeof control;
    cmsghdr* header = CMSG_FIRSTHDR(&message);
    header->cmsg_level = SOL_SOCKET;
    header->cmsg_type = SCM_RIGHTS;
    header->cmsg_len = CMSG_LEN(sizeof attached);
    std::memcpy(CMSG_DATA(header), &attached, sizeof attached);
  }
  ssize_t sent = -1;
  do {
    sent = ::sendmsg(socket, &message, MSG_NOSIGNAL | MSG_DONTWAIT);
  } while (sent < 0 && errno == EINTR);
  return sent == static_cast<ssize_t>(datagram.size());
}

ReceiveStatus receive_datagram(int socket, std::span<std::byte> buffer, std::size_t* size, FileDescriptor* attached) {
  iovec part{buffer.data(), buffer.size()};
  Control control{};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = &control;
  message.msg_controllen = sizeof control;
  ssize_t received = -1;
  bool reset = false;
  do {
    received = ::recvmsg(socket, &message, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
    // A peer that closed before it had read all is reported once, ahead of what it said before: its last words follow.
  } while (received < 0 && (errno == EINTR || (errno == ECONNRESET && !std::exchange(reset, true))));
  if (received < 0) return errno == EAGAIN ? ReceiveStatus::kNothingYet : ReceiveStatus::kClosed;
  for (cmsghdr* header = CMSG_FIRSTHDR(&message); header != nullptr; header = CMSG_NXTHDR(&message, header)) {
    if (header->cmsg_level != SOL_SOCKET || header->cmsg_type != SCM_RIGHTS) continue;
    int fd = -1;
    std::memcpy(&fd, CMSG_DATA(header), sizeof fd);
    FileDescriptor came(fd);
    if (attached != nullptr) *attached = std::move(came);
  }
  // An empty datagram can't be told from the end of the connection; no message of ours is empty.
  if (received == 0) return ReceiveStatus::kClosed;
  *size = static_cast<std::size_t>(received);
  return ReceiveStatus::kDatagram;
}

}  // namespace vantage::sim
