#include "lcmtypes/link/event_log.h"

#include <array>
#include <cstdlib>
#include <functional>
#include <random>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <lcm/eventlog.h>
#include <sched.h>
#include <signal.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "lcmtypes/link/pending_log.h"
#include "tests/input_fault.h"

namespace vantage {
namespace {

namespace fs = std::filesystem;

class EventLog : public testing::Test {
 protected:
  void SetUp() override {
    path_ = fs::path(testing::TempDir()) /
            (std::string(testing::UnitTest::GetInstance()->current_test_info()->name()) + ".lcm");
    LogWriter writer(path_);
    for (int i = 0; i < 5; ++i) {
      writer.write(1000 + i, "CHANNEL_" + std::to_string(i),
                   std::vector<std::uint8_t>(static_cast<std::size_t>(100 * i), 7));
    }
  }
  std::string fault() {
    return input_fault([this] {
      LogReader reader(path_);
      for (LogEvent event; reader.next(&event);) {
      }
    });
  }
  fs::path path_;
};

TEST_F(EventLog, IsReadBackByUsAndByLcm) {
  LogReader reader(path_);
  LogEvent event;
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(reader.next(&event));
    EXPECT_EQ(event.number, i);
    EXPECT_EQ(event.utime, 1000 + i);
    EXPECT_EQ(event.channel, "CHANNEL_" + std::to_string(i));
    EXPECT_EQ(event.bytes.size(), static_cast<std::size_t>(100 * i));
  }
  EXPECT_FALSE(reader.next(&event));

  lcm_eventlog_t* log = lcm_eventlog_create(path_.c_str(), "r");
  ASSERT_NE(log, nullptr);
  for (int i = 0; i < 5; ++i) {
    lcm_eventlog_event_t* theirs = lcm_eventlog_read_next_event(log);
    ASSERT_NE(theirs, nullptr);
    EXPECT_EQ(theirs->timestamp, 1000 + i);
    EXPECT_EQ(theirs->datalen, 100 * i);
    lcm_eventlog_free_event(theirs);
  }
  EXPECT_EQ(lcm_eventlog_read_next_event(log), nullptr);
  lcm_eventlog_destroy(log);
}

TEST_F(EventLog, EveryCutIsFound) {
  const auto whole = fs::file_size(path_);
  int clean_ends = 0;
  for (auto size = whole - 1; size > 0; --size) {
    fs::resize_file(path_, size);
    if (fault().empty()) ++clean_ends;
  }
  EXPECT_EQ(clean_ends, 4);  // only between two events
  fs::resize_file(path_, 0);
  EXPECT_NE(fault().find("is empty"), std::string::npos);
}

TEST_F(EventLog, DamageIsNamedWithItsPlace) {
  std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(28 + 9);  // the second event's sync word
  file.put('x');
  file.close();
  EXPECT_EQ(fault(), path_.string() + ": at byte 37: the log is damaged (no event begins here)");
  std::ofstream(path_) << "this is text, and long enough to be taken for a header";
  EXPECT_NE(fault().find("not an LCM log"), std::string::npos);
  fs::remove(path_);
  EXPECT_NE(fault().find("no such file"), std::string::npos);
}

TEST_F(EventLog, RandomBytesNeverCrashTheReader) {
  const unsigned seed = 5;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  std::ifstream in(path_, std::ios::binary);
  const std::string good((std::istreambuf_iterator<char>(in)), {});
  for (int i = 0; i < 300; ++i) {
    std::string bytes = good;
    for (int k = 0; k < 5; ++k) bytes[random() % bytes.size()] = static_cast<char>(random());
    std::ofstream(path_, std::ios::binary) << bytes;
    fault();
  }
}

/// Bytes that depend on the event's number, so that what is read back can be told from anything else.
std::vector<std::uint8_t> payload(std::int64_t number, std::size_t most_bytes = 3000) {
  std::mt19937 random(static_cast<unsigned>(number));
  std::vector<std::uint8_t> bytes(random() % most_bytes);
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
  return bytes;
}

void write_event(LogWriter& writer, std::int64_t number, std::size_t most_bytes = 3000) {
  writer.write(1000 + number, "CHANNEL", payload(number, most_bytes));
}

/// Reads a log whose events are all `write_event`'s, from `first` on; how many there are.
std::int64_t count_events(LogReader& reader, std::int64_t first = 0, std::size_t most_bytes = 3000) {
  std::int64_t count = 0;
  for (LogEvent event; reader.next(&event); ++count) {
    EXPECT_EQ(event.number, first + count);
    EXPECT_EQ(event.utime, 1000 + first + count);
    EXPECT_EQ(event.bytes, payload(first + count, most_bytes));
  }
  return count;
}

/// A log of its own folder, so that parts of other tests are not in the way.
class LogParts : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    log_ = folder_ / "log.lcm";
  }
  void write(std::int64_t events, std::uint64_t part_bytes) {
    LogWriter writer(log_, {.part_bytes = part_bytes});
    for (std::int64_t i = 0; i < events; ++i) write_event(writer, i);
  }
  std::int64_t count(LogReaderOptions options = {}) {
    LogReader reader(log_, options);
    return count_events(reader);
  }
  std::size_t files() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }
  void remove_parts_after(std::size_t part) {
    while (fs::remove(log_part(log_, ++part))) {
    }
  }
  fs::path folder_, log_;
};

TEST_F(LogParts, EachPartIsALogAndTogetherTheyAreOne) {
  write(60, 20'000);
  const std::size_t parts = count_log_parts(log_);
  EXPECT_GT(parts, 2u);
  EXPECT_EQ(files(), parts);
  EXPECT_EQ(count(), 60);
  std::int64_t first = 0;
  for (std::size_t part = 0; part < parts; ++part) {
    const fs::path path = log_part(log_, part);
    if (part + 1 < parts) {
      EXPECT_GE(fs::file_size(path), 20'000u);
      EXPECT_LT(fs::file_size(path), 24'000u);  // the event that filled it is not cut
    }
    lcm_eventlog_t* log = lcm_eventlog_create(path.c_str(), "r");
    ASSERT_NE(log, nullptr);
    for (; lcm_eventlog_event_t* event = lcm_eventlog_read_next_event(log); ++first) {
      EXPECT_EQ(event->eventnum, first);
      EXPECT_EQ(std::vector<std::uint8_t>(static_cast<std::uint8_t*>(event->data),
                                          static_cast<std::uint8_t*>(event->data) + event->datalen),
                payload(first));
      lcm_eventlog_free_event(event);
    }
    lcm_eventlog_destroy(log);
  }
  EXPECT_EQ(first, 60);
}

TEST_F(LogParts, LcmLogplayerPlaysThem) {
  if (std::system("command -v lcm-logplayer >/dev/null") != 0) GTEST_SKIP() << "lcm-logplayer is not installed";
  write(30, 10'000);
  int played = 0;
  for (std::size_t part = 0; part < count_log_parts(log_); ++part) {
    const std::string command = "lcm-logplayer -v --lcm-url=memq:// --speed=1000 " + log_part(log_, part).string();
    FILE* out = ::popen(command.c_str(), "r");
    ASSERT_NE(out, nullptr);
    for (char line[200]; std::fgets(line, sizeof line, out) != nullptr;) {
      if (std::string(line).find("Channel CHANNEL") != std::string::npos) ++played;
    }
    EXPECT_EQ(::pclose(out), 0);
  }
  EXPECT_EQ(played, 30);
}

TEST_F(LogParts, ANewLogLeavesNoPartOfTheOld) {
  write(60, 20'000);
  write(2, 20'000);
  EXPECT_EQ(files(), 1u);
  EXPECT_EQ(count(), 2);
}

TEST_F(LogParts, APartOfAnotherLogIsRefused) {
  write(2, 1'000'000);
  fs::rename(log_, folder_ / "kept");
  write(20, 1'000'000);
  fs::rename(folder_ / "kept", folder_ / "log.1.lcm");
  LogReader reader(log_);
  EXPECT_NE(input_fault([&] {
              count_events(reader);
            }).find("log.1.lcm: at byte 0: event 0 does not go on where the part before ends (event 19)"),
            std::string::npos);
}

TEST_F(LogParts, ResumingAfterEveryCutLosesTheCutEventOnly) {
  constexpr std::size_t kMostBytes = 60;  // small, for each cut waits for the disk
  const LogWriterOptions options{.part_bytes = 400};
  {
    LogWriter writer(log_, options);
    for (std::int64_t i = 0; i < 19; ++i) write_event(writer, i, kMostBytes);
  }
  ASSERT_GT(count_log_parts(log_), 1u);
  const std::size_t last_part = count_log_parts(log_) - 1;
  const fs::path last = log_part(log_, last_part);
  std::vector<std::uint64_t> begins;  // of the last part's events
  std::int64_t before = 0;            // events in earlier parts
  LogReader whole(log_);
  for (LogEvent event; whole.next(&event);) {
    if (event.part == last_part) {
      begins.push_back(event.offset);
    } else {
      ++before;
    }
  }
  ASSERT_GT(begins.size(), 1u);
  fs::copy_file(last, folder_ / "whole");
  const std::uint64_t size = fs::file_size(last);
  for (std::uint64_t cut = 0; cut < size; ++cut) {
    fs::copy_file(folder_ / "whole", last, fs::copy_options::overwrite_existing);
    fs::resize_file(last, cut);
    const auto next = std::upper_bound(begins.begin(), begins.end(), cut);
    const std::int64_t left = before + (next - begins.begin()) - 1;
    const std::uint64_t torn = cut - *(next - 1);
    {
      LogReader reader(log_, {.accept_torn_end = true});
      ASSERT_EQ(count_events(reader, 0, kMostBytes), left) << cut;
      ASSERT_EQ(reader.torn_bytes(), torn) << cut;
    }
    if (torn > 0) {
      ASSERT_NE(input_fault([&] {
                  LogReader reader(log_);
                  count_events(reader, 0, kMostBytes);
                }).find("the log ends within an event"),
                std::string::npos)
          << cut;
    }
    {
      const auto writer = LogWriter::resume(log_, options);
      ASSERT_EQ(writer->cut_off_bytes(), torn) << cut;
      for (std::int64_t i = left; i < left + 4; ++i) write_event(*writer, i, kMostBytes);
    }
    {
      LogReader reader(log_);
      ASSERT_EQ(count_events(reader, 0, kMostBytes), left + 4) << cut;
    }
    remove_parts_after(last_part);
  }
}

TEST_F(LogParts, ZerosAfterALossOfPowerAreATornEnd) {
  write(5, 1'000'000);
  const std::uint64_t size = fs::file_size(log_);
  fs::resize_file(log_, size + 4096);
  EXPECT_EQ(LogWriter::resume(log_)->cut_off_bytes(), 4096u);
  EXPECT_EQ(fs::file_size(log_), size);
}

TEST_F(LogParts, ResumingNeverCutsOffWholeEvents) {
  write(5, 1'000'000);
  LogEvent second;
  {
    LogReader reader(log_);
    reader.next(&second);
    reader.next(&second);
  }
  for (const std::uint64_t at : {second.offset, second.offset + 24}) {  // its sync word; its length, to 3 GiB
    write(5, 1'000'000);
    std::fstream file(log_, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(at));
    file.put(static_cast<char>(at == second.offset ? 0 : 0x60));
    file.close();
    const std::uint64_t size = fs::file_size(log_);
    EXPECT_NE(input_fault([this] { LogWriter::resume(log_); }).find("vantage-log cut"), std::string::npos);
    EXPECT_EQ(fs::file_size(log_), size);
    EXPECT_FALSE(input_fault([this] { count({.accept_torn_end = true}); }).empty());
    LogReader reader(log_);
    LogEvent event;
    EXPECT_TRUE(reader.next(&event));
    EXPECT_THROW(reader.next(&event), InputError);
    EXPECT_EQ(reader.skip_damage(), EventHeader::kBytes + second.channel.size() + second.bytes.size());
    EXPECT_EQ(count_events(reader, 2), 3);
  }
  std::ofstream(log_) << "this is text, and long enough to be taken for a header";
  EXPECT_NE(input_fault([this] { LogWriter::resume(log_); }).find("at byte 0: not an LCM log"), std::string::npos);
  EXPECT_EQ(fs::file_size(log_), 54u);
}

TEST_F(LogParts, ALogHasOneWriter) {
  const LogWriter writer(log_);
  EXPECT_NE(input_fault([this] { LogWriter second(log_); }).find("another program is writing"), std::string::npos);
  EXPECT_NE(input_fault([this] { LogWriter::resume(log_); }).find("another program is writing"), std::string::npos);
}

TEST_F(LogParts, TheDiskIsNeverFilled) {
  std::uint64_t free = 1'000'000;
  LogWriter writer(log_, {.keep_free_bytes = 999'000, .free_bytes = [&free] { return free; }});
  const std::vector<std::uint8_t> bytes(500);
  writer.write(1, "CHANNEL", bytes);
  free = 999'500;  // 535 bytes would leave 998,965
  const std::string fault = input_fault([&] { writer.write(2, "CHANNEL", bytes); });
  EXPECT_NE(fault.find("log.lcm: its disk has 0 MiB free, and 0 MiB are kept free"), std::string::npos) << fault;
  free = 999'535;
  writer.write(3, "CHANNEL", bytes);
  LogReader reader(log_);
  LogEvent event;
  EXPECT_TRUE(reader.next(&event));
  EXPECT_TRUE(reader.next(&event));
  EXPECT_EQ(event.number, 1);
  EXPECT_EQ(event.utime, 3);
  EXPECT_FALSE(reader.next(&event));
}

/// A file-size limit breaks a write in the middle, as a full disk may.
TEST_F(LogParts, AFailedWriteLeavesNothingOfItsEvent) {
  LogWriter writer(log_);
  for (std::int64_t i = 0; i < 5; ++i) write_event(writer, i);
  const std::uint64_t size = fs::file_size(log_);
  struct rlimit before {};
  ::getrlimit(RLIMIT_FSIZE, &before);
  auto* const handler = ::signal(SIGXFSZ, SIG_IGN);
  const struct rlimit limit { size + 100, before.rlim_max };
  ::setrlimit(RLIMIT_FSIZE, &limit);
  const std::string fault = input_fault([&] { writer.write(0, "CHANNEL", std::vector<std::uint8_t>(2000)); });
  ::setrlimit(RLIMIT_FSIZE, &before);
  ::signal(SIGXFSZ, handler);
  EXPECT_NE(fault.find("log.lcm: writing failed: File too large"), std::string::npos) << fault;
  EXPECT_EQ(fs::file_size(log_), size);
  write_event(writer, 5);
  EXPECT_EQ(count(), 6);
}

TEST_F(LogParts, AbandonedLogsLeaveNothingCommittedOnesAllParts) {
  write(3, 1'000'000);
  {
    PendingLog pending(log_, {.part_bytes = 5'000});
    for (std::int64_t i = 0; i < 20; ++i) write_event(pending.writer(), i);
  }
  EXPECT_EQ(files(), 1u);
  EXPECT_EQ(count(), 3);
  PendingLog pending(log_, {.part_bytes = 5'000});
  for (std::int64_t i = 0; i < 20; ++i) write_event(pending.writer(), i);
  pending.commit();
  EXPECT_EQ(count(), 20);
  EXPECT_EQ(files(), count_log_parts(log_));
  EXPECT_GT(files(), 1u);
  EXPECT_EQ(input_fault([this] { PendingLog nowhere(folder_ / "none" / "log.lcm"); }),
            (folder_ / "none" / "log.lcm").string() + ": can't be written: No such file or directory");
}

/// Runs `body` in a child process; its exit status, or -1 when it was killed.
int in_child(const std::function<int()>& body) {
  const pid_t child = ::fork();
  if (child == 0) ::_exit(body());
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

constexpr int kNoNamespace = 77;

/// A disk of 1 MiB in a mount namespace of its own. 0 when all holds, else the line that did not.
int fill_small_disk(const fs::path& folder) {
  if (::unshare(CLONE_NEWNS) != 0 && ::unshare(CLONE_NEWUSER | CLONE_NEWNS) != 0) return kNoNamespace;
  if (::mount("vantage-test", folder.c_str(), "tmpfs", 0, "size=1m") != 0) return kNoNamespace;
  const fs::path log = folder / "log.lcm";
  const auto fill = [&log](std::uint64_t keep_free) {
    LogWriter writer(log, {.part_bytes = 300'000, .keep_free_bytes = keep_free});
    std::int64_t written = 0;
    std::string fault = input_fault([&] {
      for (; written < 2000; ++written) write_event(writer, written);
    });
    LogReader reader(log);
    return std::pair(fault, count_events(reader) == written && written > 100);
  };
  const auto [kept, kept_whole] = fill(400 << 10);
  if (kept.find("and 0 MiB are kept free") == std::string::npos || !kept_whole) return 1;
  if (fs::space(folder).available < 400 << 10) return 2;
  const auto [full, full_whole] = fill(0);
  if (full.empty() || !full_whole) return 3;
  if (fs::space(folder).available > 8 << 10) return 4;
  return testing::Test::HasFailure() ? 5 : 0;
}

TEST_F(LogParts, ASmallDiskIsFilledAsFarAsAllowedAndTheLogStaysWhole) {
  const int status = in_child([this] { return fill_small_disk(folder_); });
  if (status == kNoNamespace) GTEST_SKIP() << "no mount namespace here";
  EXPECT_EQ(status, 0);
}

TEST_F(LogParts, AKilledWriterLosesNoEventThatWasWritten) {
  const unsigned seed = 7;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  LogWriter{log_};
  std::int64_t events = 0;
  for (int round = 0; round < 20; ++round) {
    std::array<int, 2> pipe{};
    ASSERT_EQ(::pipe(pipe.data()), 0);
    const pid_t child = ::fork();
    if (child == 0) {
      ::close(pipe[0]);
      const auto writer = LogWriter::resume(log_, {.part_bytes = 100'000});
      for (std::int64_t i = events;; ++i) {
        write_event(*writer, i);
        if (::write(pipe[1], &i, sizeof i) != sizeof i) ::_exit(1);
      }
    }
    ::close(pipe[1]);
    std::int64_t last = -1;
    for (auto reports = 1 + random() % 40; reports > 0; --reports) {
      ASSERT_EQ(::read(pipe[0], &last, sizeof last), static_cast<ssize_t>(sizeof last));
    }
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
    for (std::int64_t rest = 0; ::read(pipe[0], &rest, sizeof rest) == static_cast<ssize_t>(sizeof rest);) last = rest;
    ::close(pipe[0]);
    events = count({.accept_torn_end = true});
    ASSERT_GE(events, last + 1) << round;
    ASSERT_LE(events, last + 2) << round;  // one may have been written and not yet reported
  }
}

}  // namespace
}  // namespace vantage
