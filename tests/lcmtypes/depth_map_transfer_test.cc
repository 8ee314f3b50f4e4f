#include <random>

#include <gtest/gtest.h>

#include "lcmtypes/link/depth_codec.h"
#include "lcmtypes/link/depth_map_receiver.h"
#include "lcmtypes/link/depth_map_sender.h"
#include "lcmtypes/link/memory_bus.h"
#include "tests/lcmtypes/sample_depth_map.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;

/// A robot and a workstation on one bus, in simulated time.
class Transfer : public testing::Test {
 protected:
  void run(milliseconds duration, DepthMapSender& sender, DepthMapReceiver& receiver) {
    for (milliseconds t{0}; t < duration; t += milliseconds(1)) {
      clock_.advance(milliseconds(1));
      sender.step();
      while (bus_.handle(milliseconds(0))) {
      }
      receiver.step();
      while (bus_.handle(milliseconds(0))) {
      }
    }
  }

  ManualClock clock_;
  MemoryBus bus_;
  std::vector<depth_map_t> received_;
  DepthMapReceiver::Handler keep_ = [this](const depth_map_t& map) { received_.push_back(map); };
};

TEST_F(Transfer, ArrivesWholeAtTheConfiguredRate) {
  DepthMapReceiver receiver(bus_, clock_, keep_);
  DepthMapSender sender(bus_, clock_, {.rate_bit_s = 8e6});
  const depth_map_t map = pack_depth_map(sample_depth_map(320, 240));
  sender.enqueue(map);
  // 1,000 bytes a millisecond: not there shortly before the rate allows it, there shortly after.
  const auto due = milliseconds(encode_message(map).size() / 1000);
  run(due - milliseconds(3), sender, receiver);
  EXPECT_TRUE(received_.empty());
  run(milliseconds(6), sender, receiver);
  ASSERT_EQ(received_.size(), 1u);
  EXPECT_EQ(encode_message(received_[0]), encode_message(map));
  EXPECT_TRUE(sender.idle());
  EXPECT_EQ(sender.acknowledged(), 1u);
}

TEST_F(Transfer, SurvivesLossAndDuplicatesInOrder) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937 random(seed);
    received_.clear();
    MemoryBus bus;
    bus.set_fate([&random](std::string_view) {
      const unsigned dice = static_cast<unsigned>(random() % 100);
      return dice < 20 ? 0 : dice < 25 ? 2 : 1;
    });
    DepthMapReceiver receiver(bus, clock_, keep_);
    DepthMapSender sender(bus, clock_);
    std::vector<depth_map_t> sent;
    for (unsigned i = 1; i <= 6; ++i) {
      sent.push_back(pack_depth_map(sample_depth_map(160, 120, i)));
      sender.enqueue(sent.back());
    }
    for (int t = 0; t < 20'000 && !sender.idle(); ++t) {
      clock_.advance(milliseconds(1));
      sender.step();
      receiver.step();
      while (bus.handle(milliseconds(0))) {
      }
    }
    ASSERT_EQ(received_.size(), sent.size());
    for (std::size_t i = 0; i < sent.size(); ++i) EXPECT_EQ(encode_message(received_[i]), encode_message(sent[i]));
    EXPECT_EQ(sender.spool().given_up(), 0u);
    EXPECT_GT(receiver.counters().duplicate_chunks, 0u);
  }
}

TEST_F(Transfer, AFullSpoolLosesTheOldestAndSaysSo) {
  const depth_map_t first = pack_depth_map(sample_depth_map(16, 12, 1));
  const std::uint64_t bytes = 5 * encode_message(first).size() / 2;  // room for two
  DepthMapSender sender(bus_, clock_, {.spool = {.folder = {}, .most_bytes = bytes}});
  EXPECT_TRUE(sender.enqueue(first));
  EXPECT_TRUE(sender.enqueue(pack_depth_map(sample_depth_map(16, 12, 2))));
  sender.step();  // the oldest is under way already
  EXPECT_FALSE(sender.enqueue(pack_depth_map(sample_depth_map(16, 12, 3))));
  EXPECT_EQ(sender.spool().given_up(), 1u);
  DepthMapReceiver receiver(bus_, clock_, keep_);
  run(milliseconds(500), sender, receiver);
  ASSERT_EQ(received_.size(), 2u);
  EXPECT_EQ(received_[0].map_id, 2);
  EXPECT_EQ(received_[1].map_id, 3);
}

TEST_F(Transfer, AReceiverThatComesLateGetsTheMap) {
  DepthMapSender sender(bus_, clock_);
  sender.enqueue(pack_depth_map(sample_depth_map()));
  for (int t = 0; t < 1000; ++t) {
    clock_.advance(milliseconds(1));
    sender.step();
    while (bus_.handle(milliseconds(0))) {
    }
  }
  EXPECT_FALSE(sender.idle());
  DepthMapReceiver receiver(bus_, clock_, keep_);
  run(milliseconds(1000), sender, receiver);
  EXPECT_EQ(received_.size(), 1u);
  EXPECT_TRUE(sender.idle());
}

TEST_F(Transfer, ADamagedChunkIsAskedForAnew) {
  DepthMapReceiver receiver(bus_, clock_, keep_);
  DepthMapSender sender(bus_, clock_);
  const depth_map_t map = pack_depth_map(sample_depth_map());
  // Somebody else's chunk takes a place before the true one comes.
  sender.enqueue(map);
  sender.step();
  depth_map_chunk_t forged{};
  forged.session = map.session;
  forged.map_id = map.map_id;
  forged.size = kChunkBytes;
  forged.data.assign(static_cast<std::size_t>(kChunkBytes), 0);
  publish_message(bus_, channel::kDepthChunk, forged);
  run(milliseconds(1000), sender, receiver);
  ASSERT_EQ(received_.size(), 1u);
  EXPECT_EQ(encode_message(received_[0]), encode_message(map));
  EXPECT_EQ(receiver.counters().wrong_digests, 1u);
}

TEST_F(Transfer, RefusesManifestsThatClaimTooMuch) {
  DepthMapReceiver receiver(bus_, clock_, keep_, {.most_bytes = 1 << 20});
  for (const auto& [bytes, chunk_bytes, chunks] :
       {std::tuple{2 << 20, 1000, 2098}, {1000, 0, 1}, {-1, 10, 1}, {1000, 100, 11}, {1000, -100, -10}}) {
    depth_map_manifest_t manifest{};
    manifest.bytes = bytes;
    manifest.chunk_bytes = chunk_bytes;
    manifest.chunks = chunks;
    publish_message(bus_, channel::kDepthManifest, manifest);
  }
  while (bus_.handle(milliseconds(0))) {
  }
  EXPECT_EQ(receiver.counters().refused_manifests, 5u);
}

TEST_F(Transfer, WholeMapsFromALogAreTakenToo) {
  DepthMapReceiver receiver(bus_, clock_, keep_);
  publish_message(bus_, channel::kDepthMap, pack_depth_map(sample_depth_map()));
  while (bus_.handle(milliseconds(0))) {
  }
  EXPECT_EQ(received_.size(), 1u);
}

TEST_F(Transfer, MapsThatOvertakeAreHandedOverInOrder) {
  DepthMapReceiver receiver(bus_, clock_, keep_);
  DepthMapSender sender(bus_, clock_);
  // Of the first map every chunk is lost for a while; the others come through.
  bool first = true;
  bus_.set_fate([&first, sent = 0](std::string_view channel) mutable {
    return first && channel == channel::kDepthChunk && ++sent <= 40 ? 0 : 1;
  });
  for (unsigned i = 1; i <= 4; ++i) sender.enqueue(pack_depth_map(sample_depth_map(160, 120, i)));
  run(milliseconds(2000), sender, receiver);
  ASSERT_EQ(received_.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(received_[i].map_id, static_cast<std::int64_t>(i) + 1);
}

TEST_F(Transfer, NothingIsSentTwiceWhereNothingIsLost) {
  DepthMapReceiver receiver(bus_, clock_, keep_);
  DepthMapSender sender(bus_, clock_);
  for (unsigned i = 1; i <= 5; ++i) sender.enqueue(pack_depth_map(sample_depth_map(320, 240, i)));
  run(milliseconds(1000), sender, receiver);
  EXPECT_EQ(received_.size(), 5u);
  EXPECT_EQ(sender.chunks_sent_again(), 0u);
  EXPECT_EQ(receiver.counters().duplicate_chunks + receiver.counters().foreign_chunks, 0u);
}

TEST_F(Transfer, AKnownMapIsAcknowledgedAndNotHandedOverAgain) {
  DepthMapReceiver receiver(bus_, clock_, keep_);
  DepthMapSender sender(bus_, clock_);
  const depth_map_t map = pack_depth_map(sample_depth_map());
  receiver.remember(map.session, map.map_id, digest_of(encode_message(map)));
  sender.enqueue(map);
  run(milliseconds(100), sender, receiver);
  EXPECT_TRUE(sender.idle());
  EXPECT_TRUE(received_.empty());
}

TEST_F(Transfer, WhatTheHandlerThrowsAtIsNotAcknowledged) {
  DepthMapReceiver receiver(bus_, clock_, [](const depth_map_t&) { throw std::runtime_error("the disk is full"); });
  DepthMapSender sender(bus_, clock_);
  sender.enqueue(pack_depth_map(sample_depth_map()));
  EXPECT_THROW(run(milliseconds(1000), sender, receiver), std::runtime_error);
  while (bus_.handle(milliseconds(0))) {
  }
  EXPECT_EQ(sender.acknowledged(), 0u);
  EXPECT_FALSE(sender.idle());
}

TEST_F(Transfer, AFloodOfManifestsTakesBoundedMemory) {
  DepthMapReceiver receiver(bus_, clock_, keep_,
                            {.most_bytes = 1 << 20, .most_parcels = 8, .most_total_bytes = 4 << 20});
  for (int i = 0; i < 1000; ++i) {
    depth_map_manifest_t manifest{};
    manifest.session = i % 50;
    manifest.map_id = i;
    manifest.bytes = 1 << 20;
    manifest.chunk_bytes = kChunkBytes;
    manifest.chunks = (manifest.bytes + kChunkBytes - 1) / kChunkBytes;
    manifest.digest[0] = static_cast<std::uint8_t>(i);
    publish_message(bus_, channel::kDepthManifest, manifest);
    while (bus_.handle(milliseconds(0))) {
    }
  }
  EXPECT_EQ(receiver.counters().set_aside, 1000u - 4);  // four of a MiB fit
}

TEST_F(Transfer, SpareBudgetIsGivenOnlyWhenNoChunkWaits) {
  DepthMapReceiver receiver(bus_, clock_, keep_);
  DepthMapSender sender(bus_, clock_, {.rate_bit_s = 8e6});
  run(milliseconds(10), sender, receiver);
  EXPECT_TRUE(sender.spare(5000));
  EXPECT_FALSE(sender.spare(50'000));
  sender.enqueue(pack_depth_map(sample_depth_map()));
  sender.step();
  EXPECT_FALSE(sender.spare(1));
}

}  // namespace
}  // namespace vantage
