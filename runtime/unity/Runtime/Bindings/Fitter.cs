// Fits: the kimono for a wearer's measurements, with a verdict.

using System;
using System.Collections;
using System.Collections.Generic;
using System.Runtime.InteropServices;
using System.Text;

namespace Kitsuke
{
    /// <summary>What became of a fit.</summary>
    public enum Verdict
    {
        /// <summary>Every dimension is as wanted.</summary>
        Reachable,
        /// <summary>Every dimension is as wanted, in a shape that no size vouches for.</summary>
        Strayed,
        /// <summary>A size was made for such a body and is worn as it is.</summary>
        SizeDiffers,
        /// <summary>Some dimension cannot be reached.</summary>
        OutOfReach,
    }

    [StructLayout(LayoutKind.Sequential)]
    internal struct FitInformation
    {
        internal uint StructSize;
        internal Verdict Verdict;
        internal float MovedM, Novelty;
    }

    /// <summary>What a fit says as a whole.</summary>
    public struct Fit
    {
        public Verdict Verdict;
        /// <summary>How far the cloth is from what wearers of the nearest sizes have, root mean square, metres.</summary>
        public float MovedM;
        /// <summary>How little the sizes' bodies say of this wearer: 0 for one of them, 1 far from all.</summary>
        public float Novelty;
        /// <summary>The verdict in words.</summary>
        public string Explanation;
    }

    /// <summary>What became of a dimension, metres along the surface.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Reach
    {
        internal uint StructSize;
        /// <summary>By the rules.</summary>
        public float WantedM;
        /// <summary>On the fitted kimono.</summary>
        public float ReachedM;
        /// <summary>The shortest and the longest that the sizes can give.</summary>
        public float LowestM, HighestM;
    }

    /// <summary>What is known of a body: <c>new Measurements { ["body_height"] = 1.62f, ["hip_girth"] = 0.95f }</c>, metres.</summary>
    public sealed unsafe class Measurements : IEnumerable<string>
    {
        internal readonly float[] ValuesM = new float[Native.kitsuke_measurement_count()];

        public Measurements()
        {
            // What is not known is not a number.
            for (var i = 0; i < ValuesM.Length; i++) ValuesM[i] = float.NaN;
        }

        public float this[string name]
        {
            get => ValuesM[Number(name)];
            set => ValuesM[Number(name)] = value;
        }

        /// <summary>The names of all measurements that there are.</summary>
        public IEnumerator<string> GetEnumerator()
        {
            for (uint i = 0; i < ValuesM.Length; i++) yield return Name(i);
        }

        IEnumerator IEnumerable.GetEnumerator() => GetEnumerator();

        private static string Name(uint number)
        {
            var buffer = stackalloc byte[64];
            return Encoding.UTF8.GetString(buffer, (int)Native.kitsuke_measurement_name(number, buffer, (UIntPtr)64));
        }

        private static int Number(string name)
        {
            var bytes = Encoding.UTF8.GetBytes(name);
            fixed (byte* first = bytes)
            {
                var number = Native.kitsuke_measurement_from_name(first, (UIntPtr)(uint)bytes.Length);
                return number >= 0 ? number : throw new KeyNotFoundException($"there is no measurement {name}");
            }
        }
    }

    /// <summary>Fits one kimono to wearers. Takes a fraction of a second to make, a fit a fraction of a millisecond. One thread's at a
    /// time.</summary>
    public sealed unsafe class Fitter : Handle
    {
        public Fitter(Pack pack)
        {
            Call.Check(Native.kitsuke_fitter_new(pack, out handle));
        }

        protected override bool ReleaseHandle()
        {
            Native.kitsuke_fitter_free(handle);
            return true;
        }

        /// <summary>How many rule sets the kimono can be ordered by; the first is its own.</summary>
        public int RuleSetCount => (int)Native.kitsuke_fitter_rule_set_count(this);
        public int DimensionCount => (int)Native.kitsuke_fitter_dimension_count(this);
        public string RuleSetName(int index) => Name(0, index);
        public string DimensionName(int index) => Name(1, index);

        /// <summary>What would become of the kimono on this wearer.</summary>
        public Fit Fit(Measurements wearer, int rules = 0) => Fit(wearer, rules, null);

        /// <summary>The same, with the kimono itself, which is posed and drawn as any other.</summary>
        public Fit Fit(Measurements wearer, int rules, out Pack fitted)
        {
            IntPtr made;
            var fit = Fit(wearer, rules, &made);
            fitted = new Pack(made);
            return fit;
        }

        /// <summary>What became of a dimension in the last fit.</summary>
        public Reach Reach(int dimension)
        {
            var reach = new Reach { StructSize = (uint)sizeof(Reach) };
            Call.Check(Native.kitsuke_fitter_reach(this, (uint)dimension, &reach));
            return reach;
        }

        private Fit Fit(Measurements wearer, int rules, IntPtr* fitted)
        {
            var info = new FitInformation { StructSize = (uint)sizeof(FitInformation) };
            fixed (float* first = wearer.ValuesM)
                Call.Check(Native.kitsuke_fit(this, first, (UIntPtr)(uint)wearer.ValuesM.Length, (uint)rules, &info, fitted));
            return new Fit { Verdict = info.Verdict, MovedM = info.MovedM, Novelty = info.Novelty, Explanation = Call.Message() };
        }

        private string Name(uint dimension, int index)
        {
            var length = (int)Native.kitsuke_fitter_text(this, dimension, (uint)index, null, UIntPtr.Zero);
            var bytes = new byte[length + 1];
            fixed (byte* buffer = bytes) Native.kitsuke_fitter_text(this, dimension, (uint)index, buffer, (UIntPtr)(uint)bytes.Length);
            return Encoding.UTF8.GetString(bytes, 0, length);
        }
    }
}
