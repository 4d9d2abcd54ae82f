// Wearers that move: recorded motions, and live ones in the VMC protocol.

using System;
using System.Runtime.InteropServices;
using System.Text;

namespace Kitsuke
{
    [StructLayout(LayoutKind.Sequential)]
    internal struct MotionInformation
    {
        internal uint StructSize, FrameCount;
        internal double LengthS;
        internal uint NoteCount, Reserved;
    }

    /// <summary>A recorded motion (BVH, .vrma, VRM, MediaPipe, Kinect, DeepMimic or JSON Lines, told apart by content) on the wearer of
    /// one kimono. One thread's at a time.</summary>
    public sealed unsafe class Motion : Handle
    {
        private readonly MotionInformation information;

        public Motion(ReadOnlySpan<byte> bytes, Pack pack)
        {
            fixed (byte* first = &MemoryMarshal.GetReference(bytes))
                Call.Check(Native.kitsuke_motion_open(first, (UIntPtr)(uint)bytes.Length, pack, out handle));
            var info = new MotionInformation { StructSize = (uint)sizeof(MotionInformation) };
            Call.Check(Native.kitsuke_motion_info(this, &info));
            information = info;
        }

        protected override bool ReleaseHandle()
        {
            Native.kitsuke_motion_free(handle);
            return true;
        }

        /// <summary>At least 1.</summary>
        public int FrameCount => (int)information.FrameCount;

        /// <summary>Time of the last frame, seconds.</summary>
        public double LengthS => information.LengthS;

        /// <summary>Sentences that say how the file was understood where it left that open.</summary>
        public string[] Notes()
        {
            var notes = new string[information.NoteCount];
            for (uint i = 0; i < notes.Length; i++)
            {
                var bytes = new byte[(int)Native.kitsuke_motion_note(this, i, null, UIntPtr.Zero) + 1];
                fixed (byte* buffer = bytes) Native.kitsuke_motion_note(this, i, buffer, (UIntPtr)(uint)bytes.Length);
                notes[i] = Encoding.UTF8.GetString(bytes, 0, bytes.Length - 1);
            }
            return notes;
        }

        /// <summary>A frame's pose. <c>confidence</c>, if not empty, gets a number from 0 to 1 per bone.</summary>
        public Pose PoseOf(int frame, Axes axes, Span<float> confidence = default(Span<float>))
        {
            Tracked.Check(confidence);
            Pose pose;
            fixed (float* first = &MemoryMarshal.GetReference(confidence))
                Call.Check(Native.kitsuke_motion_pose(this, (uint)frame, axes, &pose, first));
            return pose;
        }

        /// <summary>The pose at a time, seconds from the first frame. Does not allocate.</summary>
        public Pose PoseAt(double timeS, Axes axes)
        {
            Pose pose;
            Call.Check(Native.kitsuke_motion_pose_at(this, timeS, axes, &pose));
            return pose;
        }
    }

    /// <summary>Receives a live wearer in the VMC protocol; the socket is the app's. One thread's at a time.</summary>
    public sealed unsafe class Receiver : Handle
    {
        public Receiver(Pack pack)
        {
            Call.Check(Native.kitsuke_receiver_new(pack, out handle));
        }

        protected override bool ReleaseHandle()
        {
            Native.kitsuke_receiver_free(handle);
            return true;
        }

        /// <summary>Takes a datagram that came at <c>nowS</c>, seconds on any clock that does not go back; returns how many poses it
        /// completed. Datagrams that are wrong are passed over.</summary>
        public int Datagram(ReadOnlySpan<byte> bytes, double nowS)
        {
            uint completed;
            fixed (byte* first = &MemoryMarshal.GetReference(bytes))
                Call.Check(Native.kitsuke_receiver_datagram(this, first, (UIntPtr)(uint)bytes.Length, nowS, &completed));
            return (int)completed;
        }

        /// <summary>The last whole pose, held and without confidence when it is older than <c>staleAfterS</c>. <c>ageS</c>: seconds since
        /// it came, infinite before the first.</summary>
        public Pose Pose(double nowS, double staleAfterS, Axes axes, out double ageS, Span<float> confidence = default(Span<float>))
        {
            Tracked.Check(confidence);
            Pose pose;
            double age;
            fixed (float* first = &MemoryMarshal.GetReference(confidence))
                Call.Check(Native.kitsuke_receiver_pose(this, nowS, staleAfterS, axes, &pose, first, &age));
            ageS = age;
            return pose;
        }

        /// <summary>Takes the last whole pose as the sender's T-pose.</summary>
        public void Calibrate() => Call.Check(Native.kitsuke_receiver_calibrate(this));
    }

    internal static class Tracked
    {
        /// The library writes a number for every bone and cannot know the length.
        internal static void Check(Span<float> confidence)
        {
            if (!confidence.IsEmpty && confidence.Length < Bones.Count)
                throw new ArgumentException($"room for {confidence.Length} numbers; {Bones.Count} are needed", nameof(confidence));
        }
    }
}
